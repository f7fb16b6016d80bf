"""Echoes as places: put right, found in strips, forgotten, and the direction of a wall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control.contour.echo_trail import EchoTrail
from tablerunner.control.fuzzy import Readings
from tablerunner.geometry.pose import Pose2

INF = math.inf


def test_echo_is_put_where_it_came_from(world) -> None:
    trail = EchoTrail(world.mounts)
    trail.hear(Readings((INF, INF, 0.78, INF, INF)), Pose2(1.0, 2.0, math.pi / 2), 0.1)
    (echo,) = trail.echoes
    assert (echo.x, echo.y) == pytest.approx((1.0, 3.0))
    trail.reset()
    trail.hear(Readings((0.78, INF, INF, INF, INF)), Pose2(1.0, 2.0, math.pi / 2), 0.1)
    (echo,) = trail.echoes
    assert (echo.x, echo.y) == pytest.approx((0.0, 2.0))


def test_strip_gives_the_nearest_echo_ahead_and_none_aside_or_behind(world) -> None:
    trail = EchoTrail(world.mounts)
    for distance in (1.5, 0.78, 2.0):
        trail.hear(Readings((INF, INF, distance, INF, INF)), Pose2(), 0.1)
    assert trail.in_strip(Pose2(), 0.0, 2.0, 0.3).x == pytest.approx(1.0)
    assert trail.in_strip(Pose2(), 0.0, 0.9, 0.3) is None  # too far
    assert trail.in_strip(Pose2(), math.pi, 2.0, 0.3) is None
    assert trail.in_strip(Pose2(0.0, 0.4, 0.0), 0.0, 2.0, 0.3) is None
    assert trail.in_strip(Pose2(0.0, 0.2, 0.0), 0.0, 2.0, 0.3) is not None


def test_reading_that_only_grows_older_counts_once_and_is_forgotten(world) -> None:
    trail = EchoTrail(world.mounts, memory_s=1.0)
    for step in range(8):
        readings = Readings((INF, INF, 0.7, INF, INF), (INF, INF, 0.1 * step, INF, INF))
        trail.hear(readings, Pose2(), 0.1)
        assert len(trail.echoes) == 1
    for step in range(8, 12):
        readings = Readings((INF, INF, 0.7, INF, INF), (INF, INF, 0.1 * step, INF, INF))
        trail.hear(readings, Pose2(), 0.1)
    assert not trail.echoes
    assert trail.known_in_strip(Pose2(), 0.0, 2.0, 0.3)  # where walls are is kept
    trail.reset()
    assert not trail.known_in_strip(Pose2(), 0.0, 2.0, 0.3)


@pytest.mark.parametrize('course', [0.0, 1.0, 2.5, -2.0])
@pytest.mark.parametrize('side', [1, -1])
def test_course_of_a_wall_is_its_direction(world, course: float, side: int) -> None:
    """Also while the robot is turned against it by 0.2 rad (less than half a cone)."""
    start = Pose2(1.0, 1.0, course)
    wall = start.transform(np.array([[-5.0, 0.6 * side], [5.0, 0.6 * side]]))[None]
    trail = EchoTrail(world.mounts)
    sensor = 0 if side == 1 else 4
    assert trail.course_of_wall(sensor, course) is None
    for step in range(20):
        pose = start @ Pose2(0.03 * step, 0.0, 0.2)
        trail.hear(world.heard(pose, wall), pose, 0.1)
    found = trail.course_of_wall(sensor, course + 0.2)
    assert math.remainder(found - course, math.tau) == pytest.approx(0.0, abs=0.03)


def test_five_mounts_are_needed(world) -> None:
    with pytest.raises(ValueError, match='5 sensors'):
        EchoTrail(world.mounts[:4])
