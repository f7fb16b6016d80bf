"""Tracking a tag from anchors on the robot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.errors import ConfigError, CovarianceError, GeometryError
from tablerunner.estimation.target_tracker import (
    Target,
    TargetTracker,
    TargetTrackerConfig,
    predict_ranges,
)
from tablerunner.odometry.motion import Motion

ANCHORS = np.array(
    [[0.25, 0.25, 0.6], [-0.25, 0.25, 0.6], [-0.25, -0.25, 0.6], [0.25, -0.25, 0.6]]
)
HEIGHT = 1.0
CONFIG = TargetTrackerConfig(range_std=0.05, acceleration=0.2)
PLACES = st.floats(-8.0, 8.0)


def tracker(config=CONFIG):
    return TargetTracker(config, ANCHORS, HEIGHT)


def ranges_at(x, y):
    return predict_ranges(np.array([x, y, 0.0, 0.0]), ANCHORS, HEIGHT)[0]


@given(PLACES, PLACES)
def test_jacobian_equals_finite_differences(x, y):
    mean, step = np.array([x, y, 0.1, 0.2]), 1e-6
    _, jacobian = predict_ranges(mean, ANCHORS, HEIGHT)
    for column in range(4):
        offset = np.zeros(4)
        offset[column] = step
        slope = (
            predict_ranges(mean + offset, ANCHORS, HEIGHT)[0]
            - predict_ranges(mean - offset, ANCHORS, HEIGHT)[0]
        ) / (2 * step)
        assert jacobian[:, column] == pytest.approx(slope, abs=1e-6)


def test_walk_is_consistent_over_many_runs():
    """NEES of a target that moves as the model says; the start is drawn from its covariance.

    Over 400 runs the mean of four degrees of freedom is 4.27: linearised ranges are 7 % too sure
    of the direction. Of 60 steps at least 80 % lie inside the two-sided 95 % bounds of 100 runs.
    """
    runs, steps, dt = 100, 60, 0.1
    nees = np.zeros((runs, steps))
    for run in range(runs):
        rng = np.random.default_rng(run)
        covariance = np.diag([0.04, 0.04, 0.09, 0.09])
        truth = np.array([3.0, 1.0, 0.0, 0.0])
        target = Target(rng.multivariate_normal(truth, covariance), covariance)
        tracked = tracker()
        for step in range(steps):
            moved = tracked.predict(Target(truth, np.zeros((4, 4))), dt)
            truth = rng.multivariate_normal(moved.mean, moved.covariance, method='cholesky')
            measured = ranges_at(*truth[:2]) + rng.normal(scale=0.05, size=4)
            target = tracked.update(tracked.predict(target, dt), measured).target
            error = target.mean - truth
            nees[run, step] = error @ np.linalg.solve(target.covariance, error)
    # Chi-square of 400 degrees of freedom, over 100 runs: 95 % between 3.46 and 4.57.
    inside = np.mean((nees.mean(axis=0) > 3.46) & (nees.mean(axis=0) < 4.57))
    assert inside >= 0.8
    assert 3.8 < nees.mean() < 4.4


def test_start_finds_the_place_and_knows_no_velocity():
    target = tracker().start(ranges_at(2.0, -1.0))
    assert target.mean == pytest.approx([2.0, -1.0, 0.0, 0.0], abs=1e-6)
    assert target.covariance[2, 2] == CONFIG.speed_std**2


def test_start_two_ranges_leave_it_open():
    assert tracker().start([2.0, 2.1, np.nan, np.nan]) is None


@given(PLACES, PLACES, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 0.5))
def test_predict_robot_motion_leaves_the_world_as_it_is(x, y, turn, vx, distance):
    """A target that stands in the room is seen where it is, whatever the robot does."""
    target = Target(np.array([x, y, 0.0, 0.0]), np.diag([0.1, 0.2, 0.0, 0.0]))
    seen = tracker().predict(target, 1e-9, Motion(distance, turn, 1e-9))
    half = 0.5 * turn
    robot = distance * np.array([np.cos(half), np.sin(half)])
    back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assert seen.mean[:2] == pytest.approx(back @ (np.array([x, y]) - robot), abs=1e-9)
    assert np.linalg.eigvalsh(seen.covariance[:2, :2]) == pytest.approx([0.1, 0.2], abs=1e-9)


def test_predict_moves_with_the_velocity_and_grows_less_sure():
    target = Target(np.array([1.0, 2.0, 0.5, -0.2]), np.eye(4) * 0.01)
    later = tracker().predict(target, 2.0)
    assert later.mean == pytest.approx([2.0, 1.6, 0.5, -0.2])
    # 0.01 + 4 * 0.01 from the velocity, 0.04 * 8 / 3 from its walk.
    assert later.covariance[0, 0] == pytest.approx(0.05 + 0.04 * 8.0 / 3.0)


def test_update_blocked_range_is_gated_and_the_others_count():
    target = Target(np.array([2.0, 0.0, 0.0, 0.0]), np.eye(4) * 0.01)
    measured = ranges_at(2.0, 0.0)
    measured[1] += 1.5
    update = tracker().update(target, measured)
    assert update.used.tolist() == [True, False, True, True]
    assert update.nis[1] > CONFIG.gate
    assert update.target.mean == pytest.approx(target.mean, abs=1e-6)


@pytest.mark.parametrize('value', [np.nan, np.inf, -1.0, 0.0])
def test_update_nothing_that_can_be_used_changes_nothing(value):
    target = Target(np.array([2.0, 0.0, 0.0, 0.0]), np.eye(4) * 0.01)
    update = tracker().update(target, np.full(4, value))
    assert update.target is target
    assert not update.used.any()


def test_bad_input_is_named():
    target = Target(np.array([2.0, 0.0, 0.0, 0.0]), np.eye(4) * 0.01)
    with pytest.raises(GeometryError, match=r'\(3,\) ranges to 4 anchors'):
        tracker().update(target, [1.0, 1.0, 1.0])
    with pytest.raises(CovarianceError, match='not positive'):
        tracker().update(target, [1.0] * 4, 0.0)
    with pytest.raises(GeometryError, match='at least 3'):
        TargetTracker(CONFIG, ANCHORS[:2], HEIGHT)
    with pytest.raises(ConfigError, match='acceleration'):
        TargetTrackerConfig(acceleration=0.0)
