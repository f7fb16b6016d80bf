"""The whole robot in one process: it delivers, always the same way, and stops when it must."""

from __future__ import annotations

import itertools
import math

import pytest

from tablerunner.control import Destination, MissionState, SafetyState, table_stop
from tablerunner.experiments.closed_loop import ClosedLoop, LoopSettings, LoopStep
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import AnchorPlace, Box, Person, Scenario, Table, Wall
from tablerunner.types import seconds

CORNERS = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0))


def room(*boxes: Box, people: tuple[Person, ...] = ()) -> Scenario:
    return Scenario(
        name='small',
        walls=(Wall(CORNERS, 'outer wall', closed=True),),
        tables=(Table('table_1', 5.2, 3.2, (4.4, 2.2, 0.0), length=0.8),),
        boxes=boxes,
        anchors=tuple(AnchorPlace(f'A{i}', (x, y, 2.2)) for i, (x, y) in enumerate(CORNERS)),
        people=people,
        start=(0.8, 0.8, 0.0),
    )


def driven(
    scenario: Scenario,
    seed: int,
    settings: LoopSettings,
    known: Scenario | None = None,
    longest_s: float = 120.0,
) -> list[LoopStep]:
    loop = ClosedLoop(scenario, seed, settings, known)
    return list(loop.drive((table_stop(scenario, 'table_1', 1.0),), longest_s=longest_s))


@pytest.mark.parametrize(
    ('controller', 'unknown'), [('fuzzy', True), ('fuzzy', False), ('pure_pursuit', False)]
)
def test_delivers_and_comes_home(controller: str, unknown: bool) -> None:
    """Truly there, not only by its own opinion: tolerance and 0.1 m of localisation error."""
    scenario = room()
    steps = driven(scenario, 3, LoopSettings(controller=controller, unknown_start=unknown))
    assert steps[-1].status.state is MissionState.DONE
    waits = [step for step in steps if step.status.state is MissionState.WAITING]
    assert max(step.truth.pose.distance_to(Pose2(4.4, 2.2)) for step in waits) < 0.22
    assert steps[-1].truth.pose.distance_to(scenario.start_pose) < 0.22
    assert not any(step.contacts for step in steps)
    known = [step.error_m for step in steps if step.heading_std_rad < 0.2]
    assert max(known) < 0.3


def test_steps_come_at_the_rate_of_control_on_the_clock_of_the_simulation() -> None:
    steps = driven(room(), 1, LoopSettings(), longest_s=6.0)
    apart = [seconds(b.stamp - a.stamp) for a, b in itertools.pairwise(steps)]
    assert min(apart) == pytest.approx(0.04)  # ticks of 20 ms: 40 or 60 ms
    assert max(apart) == pytest.approx(0.06)
    assert sum(apart) / len(apart) == pytest.approx(0.05, abs=1e-3)


def test_same_seed_same_drive_bit_for_bit() -> None:
    person = Person('guest', ((1.5, 3.4), (5.0, 1.0)))
    first, again, other = (
        [
            step.truth.pose
            for step in driven(room(people=(person,)), seed, LoopSettings(), longest_s=12.0)
        ]
        for seed in (5, 5, 6)
    )
    assert first == again
    assert first[:100] != other[:100]


def test_what_is_not_on_the_map_is_not_planned_round_but_heard() -> None:
    chair = Box('chair', 2.6, 1.5, 0.5, 0.5)
    blind, sharp = room(), room(chair)
    steps = driven(sharp, 2, LoopSettings(controller='pure_pursuit'), known=blind, longest_s=15.0)
    path = next(step.status.path for step in steps if step.status.path is not None)
    off = [math.dist((2.6, 1.5), path.at(arc)) for arc in (1.0, 1.5, 2.0, 2.5)]
    assert min(off) < 0.3
    assert any(step.safety.state is SafetyState.STOP and step.safety.blocked for step in steps)
    assert not any(step.contacts for step in steps)


def test_refuses_a_stop_in_the_wall_and_ends_an_endless_drive() -> None:
    loop = ClosedLoop(room(), 0)
    with pytest.raises(Exception, match='obstacle'):
        next(loop.drive((Destination('x', Pose2(0.1, 1.0)),)))
    steps = list(loop.drive((Destination('far', Pose2(5.0, 0.8)),), longest_s=2.0))
    assert steps[-1].time_s == pytest.approx(2.0, abs=0.1)
    assert not steps[-1].status.state.is_final
