"""Motions follow arcs, and their covariance is what noise makes of many runs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, MotionNoise, advance, between_poses

POSES = st.builds(Pose2, st.floats(-20, 20), st.floats(-20, 20), st.floats(-math.pi, math.pi))


@given(POSES, st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
def test_between_poses_undoes_advance(pose, distance, turn):
    """The motion found between two poses is the one that led from one to the other."""
    found = between_poses(pose, advance(pose, Motion(distance, turn, 0.1)), 0.1)
    assert found.distance_m == pytest.approx(distance, abs=1e-9)
    assert difference(found.turn_rad, turn) == pytest.approx(0.0, abs=1e-9)


def test_advance_round_a_circle_comes_back():
    """A full circle of radius 1 in 1000 steps ends where it began, half-way at its far side."""
    pose, step = Pose2(1.0, 0.0, math.pi / 2), Motion(2 * math.pi / 1000, 2 * math.pi / 1000, 0.02)
    for k in range(1000):
        pose = advance(pose, step)
        if k == 499:
            assert (pose.x, pose.y) == pytest.approx((-1.0, 0.0), abs=1e-4)
    assert (pose.x, pose.y) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert pose.heading == pytest.approx(math.pi / 2, abs=1e-9)


def test_noise_variances_add_up_over_parts_of_a_motion():
    """Ten tenths of a motion gather the variance of the whole: no step length is favoured."""
    noise = MotionNoise()
    whole = noise.variances(Motion(2.0, 0.5, 3.0))
    part = noise.variances(Motion(0.2, 0.05, 0.3))
    assert whole == pytest.approx([10 * value for value in part])
    assert np.all(np.array(noise.variances(Motion(-2.0, -0.5, 3.0))) == whole)
