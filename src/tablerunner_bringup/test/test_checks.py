"""What a demo claims to show: by the truth, and not without having met it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tablerunner.scenario import Box, Person, Scenario
from tablerunner_bringup.checks import blocked_ways, emergency, failures, people_in_the_way
from tablerunner_bringup.emergency_drill import DrillReport

ROOM = Scenario(
    name='room',
    boxes=(
        Box('pillar', 3.0, -2.0, 0.5, 0.5),
        Box('crates', 3.0, 0.0, 0.5, 0.5, unmapped=True),
    ),
    people=(
        Person('guest', route=((5.0, 0.0),)),
        Person('waiter', route=((0.0, 3.0), (5.0, 3.0))),
    ),
)
STRAIGHT = np.linspace([0.0, 0.0], [8.0, 0.0], 161)
AROUND = np.array([(0.0, 0.0), (2.0, 0.8), (6.0, 0.8), (8.0, 0.0)])
FAR = STRAIGHT + np.array([0.0, 2.0])


def driven(points: np.ndarray) -> np.ndarray:
    """Return places every few centimetres along a way."""
    x = np.linspace(0.0, 8.0, 400)
    return np.column_stack([x, np.interp(x, *points.T)])


@pytest.mark.parametrize(
    ('judge', 'name', 'gap'),
    [
        (blocked_ways, 'way blocked by crates', 0.8 - 0.25 - 0.25),
        (people_in_the_way, 'guest in the way', 0.8 - 0.25 - 0.25),
    ],
)
def test_what_was_planned_through_and_passed_is_shown(judge, name, gap):
    """Only what the robot could not know is looked at: no pillar, nobody who walks."""
    (check,) = judge(ROOM, [FAR, STRAIGHT], driven(AROUND))
    assert check.name == name
    assert check.passed
    assert check.numbers['plans_through_it'] == 1.0
    assert check.numbers['least_distance_m'] == pytest.approx(gap, abs=0.01)
    assert failures([check]) == []


@pytest.mark.parametrize('judge', [blocked_ways, people_in_the_way])
def test_what_was_never_met_is_not_shown(judge):
    """A robot that never planned to go there proves nothing by not having touched it."""
    (check,) = judge(ROOM, [FAR], driven(AROUND))
    assert not check.passed
    assert 'nothing was shown' in check.words


@pytest.mark.parametrize('judge', [blocked_ways, people_in_the_way])
def test_what_was_driven_into_is_a_failure(judge):
    (check,) = judge(ROOM, [STRAIGHT], driven(STRAIGHT))
    assert not check.passed
    assert failures([check]) == [f'{check.name}: it was touched']


GOOD = DrillReport(0.5, 0.4, 1.1, 0.5, 0.001, 0.8)


@pytest.mark.parametrize(
    ('changes', 'passed', 'words'),
    [
        ({}, True, 'stood 0.40 m after the call at 0.50 m/s'),
        ({'stopped_within_m': 0.51}, False, 'at most 0.50 m'),
        ({'moved_while_held_m': 0.03}, False, 'moved 3.0 cm'),
        ({'drove_on_after_s': math.nan}, False, 'did not drive on'),
        ({'stopped_within_m': math.nan}, False, 'did not stand'),
        ({'stopped_within_m': math.nan, 'speed_m_s': math.nan}, False, 'never tried'),
    ],
)
def test_emergency_stop_is_judged_by_its_figures(changes, passed, words):
    check = emergency(dataclasses.replace(GOOD, **changes))
    assert check.passed is passed
    assert words in check.words
