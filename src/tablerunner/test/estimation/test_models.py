"""Analytic Jacobians equal finite differences; the range model equals plain geometry."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.estimation.models.motion_model import input_noise, move, move_many, transport
from tablerunner.estimation.models.range_model import (
    predict_range,
    predict_range_many,
    predict_ranges,
)
from tablerunner.estimation.models.state import HEADING, RANGE_BIAS, RANGE_DELAY
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion

STATES = st.tuples(
    st.floats(-10, 10),
    st.floats(-10, 10),
    st.floats(-3, 3),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.floats(-0.1, 0.1),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
).map(np.array)
TWISTS = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.5, 1.5))
MOTIONS = st.builds(Motion, st.floats(0.001, 0.3), st.floats(-0.5, 0.5), st.floats(0.01, 0.2))
H = 1e-6


def unwrapped(after, before):
    delta = after - before
    delta[HEADING] = wrap(float(delta[HEADING]))
    return delta


@given(STATES, MOTIONS)
def test_move_jacobian_by_state_equals_finite_differences(mean, motion):
    """d(moved)/d(state), column by column."""
    by_state = move(mean, motion).by_state
    for column in range(len(mean)):
        step = np.zeros(len(mean))
        step[column] = H
        slope = unwrapped(move(mean + step, motion)[0], move(mean - step, motion)[0]) / (2 * H)
        assert by_state[:, column] == pytest.approx(slope, abs=1e-6)


@given(STATES, MOTIONS)
def test_move_jacobian_by_input_equals_finite_differences(mean, motion):
    """d(x, y, heading)/d(distance, turn)."""
    gx, gy, ex, ey, turned = move(mean, motion).by_input
    by_input = np.array([[gx, ex], [gy, ey], [0.0, turned]])
    for column, (distance, turn) in enumerate([(H, 0.0), (0.0, H)]):
        ahead = Motion(motion.distance_m + distance, motion.turn_rad + turn, motion.dt_s)
        behind = Motion(motion.distance_m - distance, motion.turn_rad - turn, motion.dt_s)
        slope = unwrapped(move(mean, ahead)[0], move(mean, behind)[0])[:3] / (2 * H)
        assert by_input[:, column] == pytest.approx(slope, abs=1e-6)


@given(STATES, MOTIONS, st.integers(0, 1000))
def test_transport_equals_the_full_product(mean, motion, seed):
    """F P F' + G diag(variances) G', and symmetric to the last bit."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(len(mean), len(mean)))
    covariance = root @ root.T
    covariance = 0.5 * (covariance + covariance.T)
    distance, turn = rng.uniform(size=2)
    moved = move(mean, motion)
    gx, gy, ex, ey, turned = moved.by_input
    slope = np.array([[gx, ex], [gy, ey], [0.0, turned]])
    full = moved.by_state @ covariance @ moved.by_state.T
    full[:3, :3] += slope @ np.diag([distance, turn]) @ slope.T
    noise = np.zeros((len(mean), len(mean)))
    input_noise(noise, moved.by_input, distance, turn)
    carried = transport(covariance, moved.by_state, noise)
    assert carried == pytest.approx(full, abs=1e-9)
    assert np.array_equal(carried, carried.T)


@given(STATES, MOTIONS)
def test_move_many_equals_move(mean, motion):
    """Many states at once move as each alone; headings are left unwrapped."""
    other = mean + 0.01
    moved = move_many(np.array([mean, other]), motion)
    for row, alone in zip(moved, (mean, other), strict=True):
        assert unwrapped(row, move(alone, motion).mean) == pytest.approx(0.0, abs=1e-12)


def test_move_at_standstill_holds_the_heading_against_the_bias():
    """Where odometry says nothing moved, the gyro's bias turns nothing."""
    mean = np.array([1.0, 2.0, 0.5, 0.01, 0.01, 0.02, 0.0, 0.1, 0.01])
    moved, by_state, _ = move(mean, Motion(0.0, 0.0, 10.0))
    assert np.array_equal(moved, mean)
    assert np.array_equal(by_state, np.eye(len(mean)))


@given(STATES, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.integers(0, 1), TWISTS)
def test_predict_range_jacobian_equals_finite_differences(mean, arm_x, arm_y, index, twist):
    """d(range)/d(state), with lever arm, delay and the anchor's own bias."""
    anchor, arm = (13.0, 4.0, 2.25), (arm_x, arm_y, 1.1)
    _, jacobian = predict_range(mean, anchor, arm, index, twist)
    for column in range(len(mean)):
        step = np.zeros(len(mean))
        step[column] = H
        ahead, _ = predict_range(mean + step, anchor, arm, index, twist)
        behind, _ = predict_range(mean - step, anchor, arm, index, twist)
        assert jacobian[column] == pytest.approx((ahead - behind) / (2 * H), abs=1e-6)


@given(STATES, TWISTS)
def test_predict_range_many_equals_predict_range(mean, twist):
    """Many states at once read what each alone reads."""
    anchor, arm = (13.0, 4.0, 2.25), (0.2, -0.1, 1.1)
    many = predict_range_many(np.array([mean, mean + 0.01]), anchor, arm, 1, twist)
    for value, alone in zip(many, (mean, mean + 0.01), strict=True):
        assert value == pytest.approx(predict_range(alone, anchor, arm, 1, twist)[0], abs=1e-12)


@given(STATES, TWISTS)
def test_predict_ranges_are_each_predict_range(mean, twist):
    """Several anchors at one instant: the same values and rows, to the last bit."""
    arm = (0.2, -0.1, 1.1)
    anchors = [((13.0, 4.0, 2.25), 1), ((-3.0, 8.0, 2.0), 0)]
    expected, jacobian = predict_ranges(mean, anchors, arm, twist)
    for value, row, (anchor, index) in zip(expected, jacobian, anchors, strict=True):
        alone, slope = predict_range(mean, anchor, arm, index, twist)
        assert value == alone
        assert np.array_equal(row, slope)


def test_predict_range_of_late_stamps_is_where_the_robot_was():
    """At 0.5 m/s away from the anchor, a stamp 0.1 s late has read 5 cm less."""
    mean = np.zeros(9)
    mean[RANGE_DELAY] = 0.1
    expected, _ = predict_range(mean, (-10.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, (0.5, 0.0))
    assert expected == pytest.approx(9.95)


def test_predict_range_adds_the_bias_of_its_own_anchor():
    """A tag 3-4-12 away reads 13 and its bias; a tag on the anchor has no direction."""
    mean = np.array([3.0, 4.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.0, 0.01])
    assert predict_range(mean, (0, 0, 12), (0, 0, 0), 1)[0] == pytest.approx(13.33)
    touching, jacobian = predict_range(mean, (3, 4, 0), (0, 0, 0), 0)
    assert touching == pytest.approx(0.1)
    assert np.all(jacobian[:3] == 0.0)
    assert jacobian[RANGE_BIAS] == 1.0
    assert math.isfinite(touching)
