"""The safety stop in the simulator, under a controller that is out of its mind."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from tablerunner.experiments.crowd import all_out
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.types import Velocity


@pytest.mark.parametrize('degrees', range(-90, 91, 15))
def test_full_speed_at_a_wall_never_touches_it(
    degrees: int, hall: Callable[[int, float], Scenario], make_loop: Callable[..., Any]
) -> None:
    """Whatever the angle at which a robot runs at a wall, and however it is steered there."""
    room = hall(degrees + 90, 1.0).replace(people=())
    for turn in (0.0, 0.25):
        loop = make_loop(room, degrees + 90, Pose2(6.5, 4.0, math.radians(degrees)))
        loop.drive(lambda _now, _pose, rate=turn: Velocity(5.0, rate), 12.0)
        assert loop.contacts == []
        assert loop.refusals == []
        assert loop.top_speed > 0.5


@pytest.mark.parametrize('yielding', [0.0, 0.9])
def test_full_speed_among_people_hits_nobody(
    yielding: float,
    hall: Callable[[int, float], Scenario],
    make_loop: Callable[..., Any],
) -> None:
    """Six people in a small hall, some of whom never give way; a controller out of its mind."""
    fast = 0
    for seed in range(6):
        loop = make_loop(hall(seed, yielding), seed)
        loop.drive(lambda now, _pose, seed=seed: all_out(now, seed), 20.0)
        assert loop.faults == [], seed
        fast += loop.top_speed > 0.5
    assert fast >= 2  # in the others somebody stands before the robot all the time
