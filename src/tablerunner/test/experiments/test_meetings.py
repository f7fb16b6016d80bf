"""Who met whom, and who passed whom."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.experiments.meetings import Meetings
from tablerunner.geometry.pose import Pose2


def meet(way: Callable[[float], tuple[float, float]]) -> Meetings:
    """Watch one robot on a way, at times 0 to 1, past another at the origin."""
    meetings = Meetings()
    for time in np.linspace(0.0, 1.0, 400):
        meetings.note({'one': Pose2(), 'two': Pose2(*way(float(time)))})
    return meetings


def test_who_drives_past_has_crossed() -> None:
    (meeting,) = meet(lambda time: (6.0 * time - 3.0, 0.7)).past
    assert meeting.crossed
    assert meeting.nearest == pytest.approx(0.7, abs=1e-3)
    # From 1 m away at the one side to 1.2 m at the other, clockwise.
    swing = math.pi - math.asin(0.7 / 1.0) - math.asin(0.7 / 1.2)
    assert meeting.swung == pytest.approx(-swing, abs=0.06)


def test_who_comes_and_goes_back_has_not() -> None:
    (meeting,) = meet(lambda time: (0.8 + abs(4.0 * time - 2.0), 0.0)).past
    assert not meeting.crossed
    assert meeting.nearest == pytest.approx(0.8, abs=0.01)


def test_who_passes_far_off_has_not_met() -> None:
    assert meet(lambda time: (6.0 * time - 3.0, 1.1)).past == []


def test_wavering_at_the_limit_is_one_meeting_and_coming_back_another() -> None:
    """Between 1 m and 1.2 m a meeting goes on."""
    assert len(meet(lambda time: (1.05 + 0.1 * math.sin(60.0 * time), 0.0)).past) == 1
    assert len(meet(lambda time: (1.2 + 0.5 * math.cos(4.0 * math.pi * time), 0.0)).past) == 2


def test_each_pair_meets_for_itself() -> None:
    meetings = Meetings()
    meetings.note({'one': Pose2(), 'two': Pose2(0.8, 0.0), 'three': Pose2(5.0, 0.0)})
    meetings.note({'one': Pose2(), 'two': Pose2(0.8, 0.0), 'three': Pose2(0.0, 0.9)})
    assert len(meetings.past) == 2
