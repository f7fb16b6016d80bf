"""The EKF's covariance is the one its errors really have, when the noise is as it assumes."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf, bias_covariance
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, MotionNoise, advance
from tablerunner.types import Anchor, RangeSample

RUNS = 60
STEPS = 600
CONFIG = EstimatorConfig(motion=MotionNoise(), huber=100.0, gate=1e6, persistence=4.0, doubt=4.0)
PRIOR = np.array([0.2, 0.2, 0.1])


def run(room, seed):
    """Return NEES at every fifth step, and NIS of every range, of one drawn run."""
    rng = np.random.default_rng(seed)
    scale = rng.normal(0, CONFIG.scale_std)
    drift = rng.normal(0, CONFIG.gyro_bias_std)
    turn_scale = rng.normal(0, CONFIG.turn_scale_std)
    delay = rng.normal(0, CONFIG.range_delay_std)
    biases = rng.multivariate_normal(np.zeros(4), bias_covariance(CONFIG, 4))
    scales = rng.normal(0, CONFIG.range_scale_std, 4)
    start = np.array([6.0, 4.5, 0.3])
    true = Pose2(*(start + rng.normal(0, PRIOR)))
    ekf = Ekf(CONFIG, room.anchors, room.lever)
    estimate = ekf.start(Start(1, start, np.diag(PRIOR**2)))
    nees, nis = [], []
    for k in range(1, STEPS + 1):
        told = Motion(0.02, 0.012 * math.sin(0.01 * k), 0.04)
        distance, turn = CONFIG.motion.variances(told)
        real = Motion(
            (1 + scale) * (told.distance_m + rng.normal(0, math.sqrt(distance))),
            (1 + turn_scale) * (told.turn_rad + rng.normal(0, math.sqrt(turn))) - drift * 0.04,
            0.04,
        )
        true = advance(true, real)
        scale += rng.normal(0, CONFIG.scale_walk * math.sqrt(0.02))
        turn_scale += rng.normal(0, CONFIG.turn_scale_walk * math.sqrt(abs(told.turn_rad)))
        delay += rng.normal(0, CONFIG.range_delay_walk * 0.2)
        drift += rng.normal(0, CONFIG.gyro_bias_walk * 0.2)
        biases += rng.normal(0, CONFIG.range_bias_walk * 0.2, 4)
        estimate = ekf.predict(estimate, told, k + 1)
        anchor: Anchor = room.anchors[k % 4]
        share = -delay / 0.04  # the stamp is late: the ranging was before
        then = advance(true, Motion(share * real.distance_m, share * real.turn_rad, 0.04))
        tag = then.transform(np.array(room.lever[:2]))
        measured = math.dist((*tag, room.lever[2]), anchor.position)
        measured += scales[k % 4] * measured + biases[k % 4] + rng.normal(0, 0.1)
        sample = RangeSample(k + 1, anchor.anchor_id, 'tag', k, measured, 0.01)
        estimate, innovation = ekf.update(estimate, sample)
        nis.append(innovation.nis)
        if k % 5 == 0:
            error = estimate.mean[:3] - [true.x, true.y, true.heading]
            error[2] = wrap(float(error[2]))
            nees.append(error @ np.linalg.solve(estimate.pose_covariance, error))
    return nees, nis


@pytest.fixture(scope='module')
def runs(room):
    """All runs, drawn from the very model that the filter assumes."""
    return [run(room, seed) for seed in range(RUNS)]


def share_inside(values, degrees):
    """Return the share of steps whose average over runs lies in the two-sided 95 % bounds."""
    mean = np.mean(values, axis=0)
    low, high = chi2.ppf([0.025, 0.975], degrees * RUNS) / RUNS
    return float(np.mean((mean > low) & (mean < high)))


def test_nees_averaged_over_runs_is_inside_two_sided_bounds(runs):
    """Neither too sure nor too shy: 90 % of the steps inside the 95 % bounds."""
    assert share_inside([nees for nees, _ in runs], 3) >= 0.9


def test_nis_averaged_over_runs_is_inside_two_sided_bounds(runs):
    """The innovations are as large as the filter says."""
    assert share_inside([nis for _, nis in runs], 1) >= 0.9
