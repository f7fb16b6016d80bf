"""Which echoes belong to the person who is followed, and what stands in the way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import sensor_mounts
from tablerunner.control.fuzzy.readings import SENSORS, Readings
from tablerunner.control.person_echoes import in_the_way, without_person
from tablerunner.scenario import RobotGeometry
from tablerunner.types import NANOSECONDS, PersonSample

MOUNTS = tuple(sensor_mounts(RobotGeometry())[f'ultrasonic_{name}'] for name in SENSORS)
RADIUS = 0.25
INF = math.inf


def person_at(x, y, std=0.05):
    return PersonSample(NANOSECONDS, 'host', (x, y), (0.0, 0.0), np.eye(4) * std**2)


def heard(**distances):
    return Readings(tuple(distances.get(name, INF) for name in SENSORS))


def test_echo_of_the_person_ahead_is_taken_out():
    """Tag on the near or the far side: the body begins between 1.2 m and 0.7 m from base_link."""
    for distance in (0.98, 0.75, 0.5):
        others = without_person(heard(front=distance), MOUNTS, person_at(1.2, 0.0), RADIUS)
        assert others.distances_m[2] == INF


def test_echo_nearer_than_the_body_can_be_stays():
    others = without_person(heard(front=0.25), MOUNTS, person_at(1.2, 0.0), RADIUS)
    assert others.distances_m[2] == 0.25


def test_echo_behind_the_person_is_of_no_concern():
    others = without_person(heard(front=2.5), MOUNTS, person_at(1.2, 0.0), RADIUS)
    assert others.distances_m[2] == INF


def test_echo_in_another_cone_stays():
    readings = heard(left=0.9, right_front=0.9, front=0.9)
    others = without_person(readings, MOUNTS, person_at(1.2, 0.0), RADIUS)
    assert others.distances_m == (0.9, INF, INF, 0.9, INF)


def test_uncertain_place_takes_out_more():
    """0.3 m of deviation across: at 1.2 m the person may stand in the next cone."""
    readings = heard(right_front=0.9)
    sure = without_person(readings, MOUNTS, person_at(1.3, 0.0), RADIUS)
    unsure = without_person(readings, MOUNTS, person_at(1.3, 0.0, 0.4), RADIUS)
    assert sure.distances_m[3] == 0.9
    assert unsure.distances_m[3] == INF


@pytest.mark.parametrize(
    ('readings', 'target', 'expected'),
    [
        (heard(front=0.5), (1.5, 0.0), True),
        (heard(front=0.9), (1.5, 0.0), False),  # too far to be noticed
        (heard(left_front=0.6), (1.5, 0.0), False),  # beside the way
        (heard(left_front=0.6), (1.0, 0.85), True),  # the way leads there
        (heard(front=0.5), (0.0, 1.5), False),  # the way leads elsewhere
        (heard(left_front=0.1), (1.5, 0.0), True),  # a turn would meet it
        (heard(left=0.1, right=0.1), (1.5, 0.0), False),
        (Readings((math.nan,) * 5), (1.5, 0.0), False),  # silent: the safety stop's
    ],
)
def test_in_the_way(readings, target, expected):
    assert in_the_way(readings, MOUNTS, target, 0.8) is expected
