"""Angles and poses obey the laws of their groups; segments agree with brute force."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.geometry.angles import TWO_PI, circular_mean, difference, wrap
from tablerunner.geometry.circles import cast_rays_at_circles, sight_crosses_circles
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import (
    cast_rays,
    crosses,
    distance_to_segments,
    polygon_edges,
    rectangle_corners,
)

COORDINATE = st.floats(-50, 50)
POSES = st.builds(Pose2, COORDINATE, COORDINATE, st.floats(-math.pi, math.pi))


def close(one: Pose2, other: Pose2) -> bool:
    return one.distance_to(other) < 1e-9 and abs(difference(one.heading, other.heading)) < 1e-9


@given(st.floats(-1e4, 1e4))
def test_wrap_any_angle_keeps_direction_and_stays_in_half_open_turn(angle):
    """A wrapped angle points the same way and lies in (-pi, pi], alone or in an array."""
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)
    assert abs(difference(float(wrap(np.array([angle]))[0]), wrapped)) < 1e-9


def test_wrap_of_minus_pi_is_plus_pi():
    """The one direction with two names gets the positive one."""
    assert wrap(-math.pi) == math.pi
    assert wrap(np.array([-math.pi, 3 * math.pi])) == pytest.approx([math.pi, math.pi])


def test_circular_mean_across_the_seam_is_the_seam():
    """The mean of 170 and -170 degrees is 180, not 0."""
    mean = circular_mean(np.radians([170.0, -170.0]))
    assert abs(difference(mean, math.pi)) < 1e-12


@given(POSES, POSES, POSES)
def test_pose_composition_is_a_group(a, b, c):
    """Composition is associative, has inverses, and between undoes it."""
    assert close((a @ b) @ c, a @ (b @ c))
    assert close(a @ a.inverse(), Pose2())
    assert close(a.between(a @ b), b)


@given(POSES, COORDINATE, COORDINATE)
def test_pose_transform_of_a_point_agrees_with_composition(pose, x, y):
    """A point transformed is the origin of the composed pose."""
    moved = pose.transform(np.array([[x, y]]))[0]
    composed = pose @ Pose2(x, y, 0.0)
    assert moved == pytest.approx([composed.x, composed.y], abs=1e-9)


@given(COORDINATE, COORDINATE, st.floats(0, TWO_PI))
def test_cast_rays_at_a_box_meets_its_outline(x, y, heading):
    """A ray from the centre of a turned box leaves it where the box's half extents say."""
    edges = polygon_edges(rectangle_corners(x, y, heading, 4.0, 2.0))
    along = np.array([[math.cos(heading), math.sin(heading)]])
    across = np.array([[-math.sin(heading), math.cos(heading)]])
    origin = np.array([[x, y]])
    assert cast_rays(origin, along, edges)[0] == pytest.approx(2.0, abs=1e-9)
    assert cast_rays(origin, across, edges)[0] == pytest.approx(1.0, abs=1e-9)
    assert distance_to_segments(origin, edges).min() == pytest.approx(1.0, abs=1e-9)


def test_cast_rays_without_segments_meets_nothing():
    """In an empty room a ray flies forever."""
    origin, direction = np.zeros((2, 2)), np.tile([1.0, 0.0], (2, 1))
    assert np.all(np.isinf(cast_rays(origin, direction, np.empty((0, 2, 2)))))


def test_crosses_tells_cut_from_missed_and_parallel():
    """A line of sight is cut by what lies across it, not by what lies beside or along it."""
    start, end = np.array([[0.0, 0.0]]), np.array([[4.0, 0.0]])
    segments = np.array(
        [
            [[2.0, -1.0], [2.0, 1.0]],
            [[2.0, 0.5], [2.0, 1.0]],
            [[5.0, -1.0], [5.0, 1.0]],
            [[0.0, 1.0], [4.0, 1.0]],
        ]
    )
    assert crosses(start, end, segments).tolist() == [[True, False, False, False]]


def test_rays_and_sight_meet_circles_where_geometry_says():
    """A ray meets a circle at its near side, from inside at once; sight is cut within a radius."""
    origin, direction = np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]])
    centres, radii = np.array([[5.0, 0.6], [5.0, 3.0]]), np.array([1.0, 1.0])
    near = 5.0 - math.sqrt(1.0 - 0.36)
    assert cast_rays_at_circles(origin, direction, centres, radii)[0] == pytest.approx(near)
    assert cast_rays_at_circles(centres[:1], direction, centres, radii)[0] == 0.0
    end = np.array([[10.0, 0.0]])
    assert sight_crosses_circles(origin, end, centres, radii).tolist() == [[True, False]]
    behind = np.array([[-5.0, 0.0]])
    assert np.isinf(cast_rays_at_circles(origin, direction, behind, radii[:1])[0])
