"""The EKF against filterpy, against its own covariance, and at the gate."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.errors import CovarianceError
from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.models.motion_model import input_noise, move
from tablerunner.estimation.models.range_model import predict_range
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion
from tablerunner.types import PoseSample, RangeSample

OPEN = EstimatorConfig(huber=100.0, gate=1e6, pose_gate=1e6, persistence=4.0, doubt=4.0)
POSE = np.array([4.0, 3.0, 0.8])


def start(covariance=(0.01, 0.01, 0.01), stamp=1):
    return Start(stamp, POSE, np.diag(covariance))


def test_predict_and_update_equal_filterpy(room):
    """A drive through filterpy's EKF on the same models gives the same numbers to 1e-9."""
    drive = room.drive(1, seconds=10.0)
    ekf = Ekf(OPEN, room.anchors, room.lever)
    ours = ekf.start(start())
    size = len(ours.mean)
    reference = ExtendedKalmanFilter(dim_x=size, dim_z=1)
    reference.x, reference.P = ours.mean.copy(), ours.covariance.copy()
    number = {anchor.anchor_id: k for k, anchor in enumerate(room.anchors)}
    ranges = {drive.odometry[sample.sequence - 1].stamp: sample for sample in drive.ranges}
    motion = Motion(0.01, 0.003, 0.02)
    for odometry in drive.odometry:
        ours = ekf.predict(ours, motion, odometry.stamp)
        moved, by_state, by_input = move(reference.x, motion)
        walk = np.zeros(size)
        walk[SCALE] = OPEN.scale_walk**2 * 0.01
        walk[TURN_SCALE] = OPEN.turn_scale_walk**2 * 0.003
        walk[GYRO_BIAS] = OPEN.gyro_bias_walk**2 * 0.02
        walk[RANGE_DELAY] = OPEN.range_delay_walk**2 * 0.02
        walk[RANGE_BIAS : RANGE_BIAS + 4] = OPEN.range_bias_walk**2 * 0.02
        noise = np.diag(walk)
        input_noise(noise, by_input, *OPEN.motion.variances(motion))
        reference.F, reference.Q = by_state, noise
        reference.predict_x = lambda u, moved=moved: setattr(reference, 'x', moved)
        reference.predict()
        sample = ranges.get(odometry.stamp)
        if sample is not None:
            ours, _ = ekf.update(ours, sample)
            k = number[sample.anchor_id]
            expect = lambda x, k=k, twist=ours.twist: predict_range(  # noqa: E731
                x, room.anchors[k].position, room.lever, k, twist
            )
            reference.update(
                np.array([sample.range_m]),
                lambda x, expect=expect: expect(x)[1][None],
                lambda x, expect=expect: np.array([expect(x)[0]]),
                R=np.array([[sample.variance_m2]]),
            )
        assert ours.mean == pytest.approx(reference.x, abs=1e-9)
        assert ours.covariance == pytest.approx(reference.P, abs=1e-9)


def test_update_covariance_stays_symmetric_and_positive(room):
    """Hundreds of updates with tiny noise leave a proper covariance."""
    drive = room.drive(2, noise=1e-3)
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    estimate = ekf.start(start())
    for sample in drive.ranges[:400]:
        estimate, _ = ekf.update(estimate, replace(sample, variance_m2=1e-8))
        assert np.array_equal(estimate.covariance, estimate.covariance.T)
        assert np.linalg.eigvalsh(estimate.covariance)[0] > -1e-12


@settings(max_examples=50)
@given(st.floats(0.5, 30.0), st.sampled_from(['A0', 'A1', 'A2', 'A3']))
def test_update_any_range_is_taken_or_leaves_everything(room, distance, anchor):
    """Inside the gate the estimate moves and sharpens; beyond it nothing changes at all."""
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    before = ekf.start(start())
    after, innovation = ekf.update(before, RangeSample(2, anchor, 'tag', 0, distance, 0.01))
    assert innovation.accepted == (innovation.nis <= innovation.gate)
    if innovation.accepted:
        assert np.trace(after.covariance) < np.trace(before.covariance)
    else:
        assert innovation.reason == 'beyond the gate'
        assert after.mean is before.mean
        assert after.covariance is before.covariance


def test_update_outlier_inside_the_gate_pulls_less_than_its_share(room):
    """Beyond the knee of Huber's loss the pull no longer grows with the innovation."""
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    before = ekf.start(start())
    expected, _ = predict_range(before.mean, room.anchors[0].position, room.lever, 0)
    pulls = []
    for deviations in (1.0, 2.0, 3.0):
        spread = math.sqrt(
            ekf.update(before, RangeSample(2, 'A0', 't', 0, expected, 0.01))[1].covariance[0, 0]
        )
        sample = RangeSample(2, 'A0', 't', 0, expected + deviations * spread, 0.01)
        after, innovation = ekf.update(before, sample)
        assert innovation.nis == pytest.approx(deviations**2)
        pulls.append(float(np.linalg.norm(after.mean[:2] - before.mean[:2])))
    assert pulls[1] == pytest.approx(1.5 * pulls[0], rel=0.01)
    assert pulls[2] == pytest.approx(pulls[1], rel=0.01)


def test_update_range_marked_nlos_counts_less(room):
    """The same range with an NLOS mark moves the estimate a fraction as far."""
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    before = ekf.start(start())
    clear = RangeSample(2, 'A0', 't', 0, 5.3, 0.01)
    moved = [
        np.linalg.norm(ekf.update(before, sample)[0].mean - before.mean)
        for sample in (clear, replace(clear, nlos_probability=1.0))
    ]
    assert moved[1] < 0.05 * moved[0]


def test_update_pose_equals_linear_kalman_filter(room):
    """A pose is a linear measurement: the closed form of the Kalman filter holds."""
    ekf = Ekf(OPEN, room.anchors, room.lever)
    before = ekf.start(start())
    noise = np.array([[0.04, 0.01, 0.0], [0.01, 0.03, 0.0], [0.0, 0.0, 0.02]])
    after, innovation = ekf.update(
        before, PoseSample(2, Pose2(4.2, 2.9, 0.7), noise, 'camera/pose')
    )
    prior = before.covariance[:3, :3]
    information = np.linalg.inv(prior) + np.linalg.inv(noise)
    assert after.covariance[:3, :3] == pytest.approx(np.linalg.inv(information), abs=1e-12)
    mean = np.linalg.solve(
        information, np.linalg.solve(prior, POSE) + np.linalg.solve(noise, [4.2, 2.9, 0.7])
    )
    assert after.mean[:3] == pytest.approx(mean, abs=1e-12)
    assert innovation.source == 'camera/pose'


def test_update_position_without_heading_leaves_heading_to_correlation(room):
    """An infinite heading variance means two rows only; across the seam heading stays wrapped."""
    ekf = Ekf(OPEN, room.anchors, room.lever)
    before = ekf.start(start())
    noise = np.diag([0.01, 0.01, np.inf])
    after, innovation = ekf.update(before, PoseSample(2, Pose2(4.2, 2.9, 0.0), noise, 'uwb/pose'))
    assert innovation.innovation.shape == (2,)
    assert after.mean[2] == before.mean[2]
    assert after.mean[:2] == pytest.approx([4.1, 2.95])


def test_biases_unobservable_from_one_anchor_keep_their_prior(room):
    """Ranges of one anchor say nothing of what the others read."""
    config = EstimatorConfig(range_bias_common_std=0.0)
    ekf = Ekf(config, room.anchors, room.lever)
    estimate = ekf.start(start())
    for k in range(50):
        estimate, _ = ekf.update(estimate, RangeSample(k + 2, 'A0', 't', k, 5.2, 0.01))
    others = np.diag(estimate.covariance)[RANGE_BIAS + 1 : RANGE_BIAS + 4]
    assert others == pytest.approx(config.range_bias_std**2)


@pytest.mark.parametrize(
    ('covariance', 'words'),
    [
        (np.diag([0.1, 0.1, np.inf]), 'not finite'),
        (np.array([[0.1, 0.05, 0], [0.0, 0.1, 0], [0, 0, 0.1]]), 'not symmetric'),
        (np.diag([0.1, -0.1, 0.1]), 'positive semi-definite'),
    ],
)
def test_start_bad_covariance_raises(room, covariance, words):
    """A start that is no distribution is refused."""
    ekf = Ekf(OPEN, room.anchors, room.lever)
    with pytest.raises(CovarianceError, match=words):
        ekf.start(Start(1, POSE, covariance))
