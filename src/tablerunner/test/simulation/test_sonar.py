"""Ultrasonic cones against exact cases."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, RobotGeometry, Scenario, Table, UltrasonicMount, Wall
from tablerunner.simulation import PersonState
from tablerunner.simulation.sonar import Sonar

MakeScenario = Callable[..., Scenario]
ONE = RobotGeometry(
    ultrasonics=(UltrasonicMount(frame='ultrasonic_front', x=0.0, y=0.0, heading=0.0),)
)
AT = Pose2(5.0, 5.0, 0.0)
HALF = 0.24  # half the opening of the cone


def hear(
    make_scenario: MakeScenario,
    pose: Pose2 = AT,
    people: tuple[PersonState, ...] = (),
    **changes: object,
) -> float:
    """Return what one sensor at the robot's centre hears."""
    scenario = make_scenario(**{'robot': ONE, 'start': None, **changes})
    return Sonar(scenario, np.random.default_rng(0)).fire(1, pose, people).range_m


def front(x: float) -> tuple[Wall, ...]:
    return (Wall(points=((x, 0.0), (x, 10.0))),)


@pytest.mark.parametrize('distance', [0.1, 1.0, 2.5, 2.99])
def test_sonar_square_to_a_wall_hears_its_distance(
    make_scenario: MakeScenario, distance: float
) -> None:
    assert hear(make_scenario, walls=front(5.0 + distance)) == pytest.approx(distance)


def test_sonar_beyond_its_reach_hears_nothing(make_scenario: MakeScenario) -> None:
    assert hear(make_scenario, walls=front(8.01)) == math.inf
    assert hear(make_scenario, walls=()) == math.inf


def test_sonar_nearer_than_it_can_hear_says_its_least(make_scenario: MakeScenario) -> None:
    """An obstacle in the sensor's ring-down is never a free way."""
    assert hear(make_scenario, walls=front(5.01)) == 0.03


@pytest.mark.parametrize('angle', [0.1, 0.2, 0.4, 0.6, 0.9])
def test_sonar_at_an_angle_hears_the_nearest_point_in_the_cone(
    make_scenario: MakeScenario, angle: float
) -> None:
    """Within half the opening the perpendicular d; beyond it d / cos(angle - half)."""
    expected = 1.0 if angle <= HALF else 1.0 / math.cos(angle - HALF)
    heard = hear(make_scenario, Pose2(5.0, 5.0, angle), walls=front(6.0))
    assert heard == pytest.approx(expected, rel=2e-3)  # rays stand 0.04 rad apart


def test_sonar_beyond_the_critical_angle_hears_nothing(make_scenario: MakeScenario) -> None:
    """All rays meet the wall at more than 0.7 rad: the sound is mirrored away."""
    pose = Pose2(5.0, 5.0, 0.7 + HALF + 0.02)
    assert hear(make_scenario, pose, walls=front(6.0)) == math.inf
    assert hear(make_scenario, Pose2(5.0, 5.0, 0.7 + HALF - 0.05), walls=front(6.0)) < 1.4


def test_sonar_hears_a_corner_at_any_angle(make_scenario: MakeScenario) -> None:
    """The edge of a box turned by 45 degrees scatters although its faces mirror away."""
    box = Box(name='b', x=6.0, y=5.0, length=0.4, width=0.4, heading=math.pi / 4, height=1.0)
    scenario_errors = {'ultrasonic': {'critical_incidence': 0.3}}
    heard = hear(make_scenario, boxes=(box,), errors=scenario_errors)
    assert heard == pytest.approx(1.0 - 0.2 * math.sqrt(2), abs=0.005)


def test_sonar_hears_tables_but_not_what_is_lower(make_scenario: MakeScenario) -> None:
    table = Table(name='t', x=6.0, y=5.0, stop=(0.3, 0.3, 0.0), length=1.0)
    step = Box(name='s', x=6.0, y=5.0, length=1.0, width=0.8, height=0.2)
    assert hear(make_scenario, tables=(table,)) == pytest.approx(0.5)
    assert hear(make_scenario, boxes=(step,)) == math.inf


def test_sonar_hears_a_person_ahead_not_beside(make_scenario: MakeScenario) -> None:
    """Distance of the body's surface; outside the cone nothing."""
    ahead = PersonState('p', Pose2(6.5, 5.0), 0.0, 0.25)
    beside = PersonState('p', Pose2(5.5, 6.0), 0.0, 0.25)
    assert hear(make_scenario, people=(ahead,)) == pytest.approx(1.25)
    assert hear(make_scenario, people=(beside,)) == math.inf
    assert hear(make_scenario, people=(beside, ahead)) == pytest.approx(1.25)


def test_sonar_does_not_hear_a_person_behind_a_wall(make_scenario: MakeScenario) -> None:
    person = PersonState('p', Pose2(6.5, 5.0), 0.0, 0.25)
    assert hear(make_scenario, people=(person,), walls=front(5.9)) == pytest.approx(0.9)
    # Also where the wall itself sends nothing back.
    pose = Pose2(5.0, 5.0, 1.2)
    hidden = PersonState('p', Pose2(5.75, 6.95), 0.0, 0.25)
    assert hear(make_scenario, pose, (hidden,), walls=front(5.3)) == math.inf
    assert hear(make_scenario, pose, (hidden,), walls=()) < 2.0


def test_sonar_fires_in_turn_each_from_its_mount(make_scenario: MakeScenario) -> None:
    """Five sensors, five readings, left to right; each measures from the rim."""
    scenario = make_scenario()
    sonar = Sonar(scenario, np.random.default_rng(0))
    pose = Pose2(8.0, 8.5, 0.0)  # 2 m before one wall, 1.5 m right of another
    heard = {s.sensor: s.range_m for s in (sonar.fire(i, pose, ()) for i in range(1, 6))}
    assert list(heard) == [mount.frame for mount in scenario.robot.ultrasonics]
    assert heard['ultrasonic_front'] == pytest.approx(2.0 - 0.22, abs=1e-3)
    assert heard['ultrasonic_left'] == pytest.approx(1.5 - 0.22, abs=1e-3)
    assert heard['ultrasonic_right'] == math.inf
    assert sonar.fire(6, pose, ()).sensor == 'ultrasonic_left'


def test_sonar_noise_misses_and_false_echoes_come_as_configured(
    make_scenario: MakeScenario,
) -> None:
    errors = {'std': 0.01, 'missing_probability': 0.1, 'false_probability': 0.05}
    scenario = make_scenario(
        robot=ONE, start=None, walls=front(7.0), errors={'ultrasonic': errors}
    )
    sonar = Sonar(scenario, np.random.default_rng(1))
    heard = np.array([sonar.fire(i, Pose2(5.0, 5.0, 0.0), ()).range_m for i in range(1, 4001)])
    missing = int(np.isinf(heard).sum())
    assert stats.binomtest(missing, 4000, 0.1 * 0.95).pvalue > 0.01
    good = heard[np.abs(heard - 2.0) < 0.05]
    assert np.std(good) == pytest.approx(0.01, rel=0.06)
    # A false echo shows where it is nearer than the true one, or where that is missing.
    early = int((heard < 1.95).sum())
    assert stats.binomtest(early, 4000, 0.05 * (1.95 - 0.03) / 2.97).pvalue > 0.01
