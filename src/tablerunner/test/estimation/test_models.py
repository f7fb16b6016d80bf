"""Analytic Jacobians equal finite differences; the range model equals plain geometry."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.estimation.models.motion_model import move, state_jacobian, transport
from tablerunner.estimation.models.range_model import predict_range
from tablerunner.estimation.models.state import HEADING, RANGE_BIAS
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion

STATES = st.tuples(
    st.floats(-10, 10),
    st.floats(-10, 10),
    st.floats(-3, 3),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
).map(np.array)
MOTIONS = st.builds(Motion, st.floats(0.001, 0.3), st.floats(-0.5, 0.5), st.floats(0.01, 0.2))
H = 1e-6


def unwrapped(after, before):
    delta = after - before
    delta[HEADING] = wrap(float(delta[HEADING]))
    return delta


@given(STATES, MOTIONS)
def test_move_jacobian_by_state_equals_finite_differences(mean, motion):
    """d(moved)/d(state), column by column."""
    _, coupling, _ = move(mean, motion)
    by_state = state_jacobian(coupling, len(mean))
    for column in range(len(mean)):
        step = np.zeros(len(mean))
        step[column] = H
        slope = unwrapped(move(mean + step, motion)[0], move(mean - step, motion)[0]) / (2 * H)
        assert by_state[:, column] == pytest.approx(slope, abs=1e-6)


@given(STATES, MOTIONS)
def test_move_jacobian_by_input_equals_finite_differences(mean, motion):
    """d(x, y, heading)/d(distance, turn)."""
    _, _, by_input = move(mean, motion)
    for column, (distance, turn) in enumerate([(H, 0.0), (0.0, H)]):
        ahead = Motion(motion.distance_m + distance, motion.turn_rad + turn, motion.dt_s)
        behind = Motion(motion.distance_m - distance, motion.turn_rad - turn, motion.dt_s)
        slope = unwrapped(move(mean, ahead)[0], move(mean, behind)[0])[:3] / (2 * H)
        assert by_input[:, column] == pytest.approx(slope, abs=1e-6)


@given(STATES, MOTIONS, st.integers(0, 1000))
def test_transport_equals_the_full_product(mean, motion, seed):
    """The short form of F P F' + Q is F P F' + Q, and symmetric to the last bit."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(len(mean), len(mean)))
    covariance = root @ root.T
    covariance = 0.5 * (covariance + covariance.T)
    noise = np.diag(rng.uniform(size=3))
    _, coupling, _ = move(mean, motion)
    jacobian = state_jacobian(coupling, len(mean))
    full = jacobian @ covariance @ jacobian.T
    full[:3, :3] += noise
    moved = transport(covariance, coupling, noise)
    assert moved == pytest.approx(full, abs=1e-9)
    assert np.array_equal(moved, moved.T)


def test_move_at_standstill_holds_the_heading_against_the_bias():
    """Where odometry says nothing moved, the gyro's bias turns nothing."""
    mean = np.array([1.0, 2.0, 0.5, 0.01, 0.02, 0.1])
    moved, coupling, _ = move(mean, Motion(0.0, 0.0, 10.0))
    assert np.array_equal(moved, mean)
    assert not coupling.any()


@given(STATES, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.integers(0, 1))
def test_predict_range_jacobian_equals_finite_differences(mean, arm_x, arm_y, index):
    """d(range)/d(state), with lever arm and the anchor's own bias."""
    anchor, arm = (13.0, 4.0, 2.25), (arm_x, arm_y, 1.1)
    _, jacobian = predict_range(mean, anchor, arm, index)
    for column in range(len(mean)):
        step = np.zeros(len(mean))
        step[column] = H
        ahead, _ = predict_range(mean + step, anchor, arm, index)
        behind, _ = predict_range(mean - step, anchor, arm, index)
        assert jacobian[column] == pytest.approx((ahead - behind) / (2 * H), abs=1e-6)


def test_predict_range_adds_the_bias_of_its_own_anchor():
    """A tag 3-4-12 away reads 13 and its bias; a tag on the anchor has no direction."""
    mean = np.array([3.0, 4.0, 1.0, 0.0, 0.0, 0.1, 0.2])
    assert predict_range(mean, (0, 0, 12), (0, 0, 0), 1)[0] == pytest.approx(13.2)
    touching, jacobian = predict_range(mean, (3, 4, 0), (0, 0, 0), 0)
    assert touching == pytest.approx(0.1)
    assert np.all(jacobian[:3] == 0.0)
    assert jacobian[RANGE_BIAS] == 1.0
    assert math.isfinite(touching)
