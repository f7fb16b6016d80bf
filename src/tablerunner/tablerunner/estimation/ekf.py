"""The default estimator: an extended Kalman filter on ranges with self-calibration.

State: x, y, heading, scale error of the wheels, bias of the yaw rate, range bias of each anchor
(`models.state`). The biases start with one common part and one of each anchor's own, so that the
filter learns both from what the geometry shows and holds what it does not: an unobservable
combination simply keeps its prior covariance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tablerunner.errors import CovarianceError
from tablerunner.estimation.correction import correct, expect
from tablerunner.estimation.estimator import (
    RANGE_SOURCE,
    EstimatorConfig,
    Measurement,
    Start,
)
from tablerunner.estimation.models.motion_model import move, transport
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3, predict_range
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    HEADING,
    RANGE_BIAS,
    SCALE,
    state_names,
)
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import (
    Anchor,
    Estimate,
    Innovation,
    Matrix,
    PoseSample,
    RangeSample,
    Vector,
)

def bias_covariance(config: EstimatorConfig, count: int) -> Matrix:
    """Return the prior covariance of the range biases, shape (count, count)."""
    common = np.full((count, count), config.range_bias_common_std**2)
    return np.asarray(common + np.eye(count) * config.range_bias_std**2)


def range_variance(config: EstimatorConfig, sample: RangeSample) -> float:
    """Return the variance of a range [m^2], with what NLOS may add to it."""
    variance = sample.variance_m2 if sample.variance_m2 > 0.0 else config.default_range_std**2
    probability = sample.nlos_probability
    if probability > 0.0:  # false for NaN
        variance += (probability * config.nlos_std) ** 2
    return variance


class ExpectedRange(NamedTuple):
    """What an anchor should read."""

    range_m: float
    variance: float  # [m^2], from the state's
    cross: Vector  # (n,), covariance of state and range
    slope: Vector  # (n,), d(range)/d(state)


class Ekf:
    """Extended Kalman filter on odometry, ranges and poses."""

    name = 'ekf'
    takes_positions = False

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self.config = config
        self.lever_arm = lever_arm
        self.state_names = state_names(tuple(anchor.anchor_id for anchor in anchors))
        self._anchors = {anchor.anchor_id: (i, anchor) for i, anchor in enumerate(anchors)}
        self._size = RANGE_BIAS + len(anchors)
        self._walk_per_time = np.zeros(self._size)
        self._walk_per_time[GYRO_BIAS] = config.gyro_bias_walk**2
        self._walk_per_time[RANGE_BIAS:] = config.range_bias_walk**2

    def start(self, start: Start) -> Estimate:
        """Return the first estimate: the given pose, all else at its prior.

        Raises
        ------
        CovarianceError
            The covariance of the start is not finite or not positive semi-definite.
        """
        config, count = self.config, len(self._anchors)
        mean = np.zeros(self._size)
        mean[:3] = start.pose
        mean[HEADING] = wrap(float(start.pose[2]))
        covariance = np.zeros((self._size, self._size))
        covariance[SCALE, SCALE] = config.scale_std**2
        covariance[GYRO_BIAS, GYRO_BIAS] = config.gyro_bias_std**2
        if start.range_biases is not None and start.covariance is not None:
            mean[RANGE_BIAS:] = start.range_biases
            rows = np.r_[0:3, RANGE_BIAS : RANGE_BIAS + count]
            covariance[np.ix_(rows, rows)] = start.covariance
        else:
            covariance[:3, :3] = start.pose_covariance
            covariance[RANGE_BIAS:, RANGE_BIAS:] = bias_covariance(config, count)
        _require_covariance(covariance)
        return Estimate(start.stamp, mean, covariance)

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        moved, coupling, by_input = move(estimate.mean, motion)
        noise = (by_input * self.config.motion.variances(motion)) @ by_input.T
        covariance = transport(estimate.covariance, coupling, noise)
        walk = self._walk_per_time * motion.dt_s
        walk[SCALE] = self.config.scale_walk**2 * abs(motion.distance_m)
        covariance.reshape(-1)[:: self._size + 1] += walk
        return Estimate(stamp, moved, covariance)

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a range or a pose, and what happened."""
        if isinstance(measurement, RangeSample):
            return self._update_range(estimate, measurement)
        return self._update_pose(estimate, measurement)

    def _update_range(
        self, estimate: Estimate, sample: RangeSample
    ) -> tuple[Estimate, Innovation]:
        config = self.config
        index, anchor = self._anchors[sample.anchor_id]
        expected = self._expect(estimate, anchor, index)
        innovation = sample.range_m - anchor.bias_m - expected.range_m
        noise = range_variance(config, sample)
        spread = expected.variance + noise
        nis = innovation * innovation / spread
        accepted = nis <= config.gate
        reason = '' if accepted else 'beyond the gate'
        after = estimate
        if accepted:
            if nis > config.huber**2:
                # Huber: beyond the knee the pull stays constant, as if the noise were larger.
                noise = spread * math.sqrt(nis) / config.huber - expected.variance
                reason = 'weight reduced'
            gain = expected.cross / (expected.variance + noise)
            mean = estimate.mean + gain * innovation
            mean[HEADING] = wrap(float(mean[HEADING]))
            covariance = self._corrected(estimate.covariance, gain, noise, expected)
            covariance = covariance + covariance.T
            covariance *= 0.5
            after = Estimate(sample.stamp, mean, covariance)
        return after, Innovation(
            sample.stamp,
            RANGE_SOURCE,
            sample.anchor_id,
            accepted,
            reason,
            np.array([innovation]),
            np.array([[spread]]),
            nis,
            config.gate,
        )

    def _expect(self, estimate: Estimate, anchor: Anchor, index: int) -> ExpectedRange:
        """Return what an anchor should read, linearised at the mean.

        A filter that spreads points instead overrides this and `_corrected`.
        """
        expected, jacobian = predict_range(estimate.mean, anchor.position, self.lever_arm, index)
        projected = estimate.covariance @ jacobian
        return ExpectedRange(expected, float(jacobian @ projected), projected, jacobian)

    def _corrected(
        self, covariance: Matrix, gain: Vector, noise: float, expected: ExpectedRange
    ) -> Matrix:
        """Return the covariance after a range, in Joseph's form (Sun 32).

        (I - K H) P (I - K H)' + K R K' with its products of rank one written out: with
        A = P - K (H P), the rest is A - (A H' - K R) K'.
        """
        half = covariance - gain[:, None] * expected.cross
        half -= (half @ expected.slope - gain * noise)[:, None] * gain
        return half

    def _update_pose(self, estimate: Estimate, sample: PoseSample) -> tuple[Estimate, Innovation]:
        # A position without heading leaves its third row out.
        rows = 3 if math.isfinite(sample.covariance[2, 2]) else 2
        place, along = predict_position(estimate.mean, sample.point)
        innovation, slope = np.zeros(rows), np.zeros((rows, self._size))
        innovation[:2] = sample.pose.x - place[0], sample.pose.y - place[1]
        slope[:2] = along
        if rows == 3:
            innovation[2] = wrap(sample.pose.heading - float(estimate.mean[HEADING]))
            slope[2, HEADING] = 1.0
        noise = sample.covariance[:rows, :rows]
        seen = expect(estimate.covariance, innovation, slope, noise)
        accepted = seen.nis <= self.config.pose_gate
        after = correct(estimate, seen, sample.stamp) if accepted else estimate
        return after, Innovation(
            sample.stamp,
            sample.source,
            '',
            accepted,
            '' if accepted else 'beyond the gate',
            innovation,
            seen.spread,
            seen.nis,
            self.config.pose_gate,
        )


def _require_covariance(covariance: Matrix) -> None:
    if not np.all(np.isfinite(covariance)):
        raise CovarianceError('the covariance of the start is not finite')
    if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=1e-12):
        raise CovarianceError('the covariance of the start is not symmetric')
    if np.linalg.eigvalsh(covariance)[0] < -1e-9 * max(1.0, float(np.trace(covariance))):
        raise CovarianceError('the covariance of the start is not positive semi-definite')
