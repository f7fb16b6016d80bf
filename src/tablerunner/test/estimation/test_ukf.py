"""The UKF: against filterpy's own, against the EKF where theory says they agree, and honest."""

from functools import partial

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.stats import chi2

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.models.motion_model import input_noise, move, move_many
from tablerunner.estimation.models.range_model import predict_range, predict_range_many
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
)
from tablerunner.estimation.ukf import Ukf
from tablerunner.odometry.motion import Motion
from tablerunner.types import RangeSample

OPEN = EstimatorConfig(huber=100.0, gate=1e6, pose_gate=1e6, persistence=4.0, doubt=4.0)
POSE = np.array([4.0, 3.0, 0.8])


def begin(filter_, covariance=(0.01, 0.01, 0.01)):
    return filter_.start(Start(1, POSE, np.diag(covariance)))


def expected_range(mean, room, index, twist):
    place = room.anchors[index].position
    return predict_range_many(mean[None], place, room.lever, index, twist)


def test_predict_and_update_equal_filterpy(room):
    """Filterpy's UKF on the same models, with points drawn anew before each update."""
    ukf = Ukf(OPEN, room.anchors, room.lever)
    ours = begin(ukf)
    size = len(ours.mean)
    motion = Motion(0.05, 0.03, 0.1)
    points = MerweScaledSigmaPoints(size, 1.0, 0.0, 0.0, sqrt_method=ukf._points.sqrt)
    reference = UnscentedKalmanFilter(
        size,
        1,
        0.1,
        hx=None,
        fx=lambda x, dt: move_many(x[None], motion)[0],
        points=points,
    )
    reference.x, reference.P = ours.mean.copy(), ours.covariance.copy()
    for k in range(40):
        walk = np.zeros(size)
        walk[SCALE] = OPEN.scale_walk**2 * 0.05
        walk[TURN_SCALE] = OPEN.turn_scale_walk**2 * 0.03
        walk[GYRO_BIAS] = OPEN.gyro_bias_walk**2 * 0.1
        walk[RANGE_DELAY] = OPEN.range_delay_walk**2 * 0.1
        walk[RANGE_BIAS : RANGE_BIAS + 4] = OPEN.range_bias_walk**2 * 0.1
        reference.Q = np.diag(walk)
        by_input = move(reference.x, motion).by_input
        input_noise(reference.Q, by_input, *OPEN.motion.variances(motion))
        ours = ukf.predict(ours, motion, 2 * k + 2)
        reference.predict()
        reference.sigmas_f = points.sigma_points(reference.x, reference.P)
        anchor = room.anchors[k % 4]
        expect = partial(expected_range, room=room, index=k % 4, twist=ours.twist)
        measured = float(expect(ours.mean)[0]) + 0.05 * (-1) ** k
        sample = RangeSample(2 * k + 2, anchor.anchor_id, 'tag', k, measured, 0.01)
        ours, _ = ukf.update(ours, sample)
        reference.update(np.array([measured]), R=np.array([[0.01]]), hx=expect)
        assert ours.mean == pytest.approx(reference.x, abs=1e-9)
        assert ours.covariance == pytest.approx(reference.P, abs=1e-9)


def test_small_covariance_equals_the_ekf(room):
    """Where the models are straight over the spread, both filters are the same."""
    drive = room.drive(1, seconds=5.0)
    filters = [kind(OPEN, room.anchors, room.lever) for kind in (Ekf, Ukf)]
    both = [begin(filter_, (1e-6, 1e-6, 1e-6)) for filter_ in filters]
    for sample in drive.ranges[:50]:
        motion = Motion(0.01, 0.002, 0.02)
        both = [
            filter_.update(filter_.predict(estimate, motion, sample.stamp), sample)[0]
            for filter_, estimate in zip(filters, both, strict=True)
        ]
    assert both[1].mean == pytest.approx(both[0].mean, abs=2e-4)
    # Scales and delay enter as products with the way: their second order, at deviations of the
    # priors, is what is left.
    assert both[1].covariance == pytest.approx(both[0].covariance, abs=1e-5)


def test_covariance_stays_symmetric_and_positive(room):
    ukf = Ukf(EstimatorConfig(scale_std=0.0), room.anchors, room.lever)
    estimate = begin(ukf, (1.0, 1.0, 1.0))
    for sample in room.drive(2, noise=1e-3).ranges[:300]:
        estimate = ukf.predict(estimate, Motion(0.01, 0.01, 0.02), sample.stamp)
        estimate, _ = ukf.update(estimate, sample)
        assert np.array_equal(estimate.covariance, estimate.covariance.T)
        assert np.linalg.eigvalsh(estimate.covariance)[0] > -1e-12
        assert -np.pi < estimate.mean[2] <= np.pi


def test_wide_start_is_not_too_sure_as_the_ekf_is(room):
    """One range with a position known to a metre and a heading to half a radian, 2000 draws.

    The mean of NEES over three degrees of freedom: the EKF's is above the 99 % bound, since the
    linearised range claims too much; the UKF's is not, it rather errs to the safe side (2.4).
    """
    rng = np.random.default_rng(5)
    anchor, lever = room.anchors[0], (0.6, 0.0, 1.1)
    spread = np.array([1.0, 1.0, 0.5])
    near = np.array([anchor.position[0] + 1.0, anchor.position[1] + 1.0, 0.3])
    means = {}
    for kind in (Ekf, Ukf):
        filter_ = kind(OPEN, room.anchors, lever)
        before = filter_.start(Start(1, near, np.diag(spread**2)))
        nees = []
        for draw in rng.multivariate_normal(before.mean, before.covariance, 2000):
            measured = predict_range(draw, anchor.position, lever, 0)[0] + rng.normal(scale=0.1)
            sample = RangeSample(1, anchor.anchor_id, 'tag', 0, measured, 0.01)
            after, _ = filter_.update(before, sample)
            error = after.mean[:3] - draw[:3]
            nees.append(error @ np.linalg.solve(after.covariance[:3, :3], error))
        means[kind] = np.mean(nees)
    high = chi2.ppf(0.995, 3 * 2000) / 2000
    assert means[Ekf] > high
    assert 2.0 < means[Ukf] < high
