"""The default estimator: an extended Kalman filter on ranges with self-calibration.

State: x, y, heading, scale errors of distances and turns, bias of the yaw rate, delay of the
ranges' stamps, range bias and range scale of each anchor (`models.state`). The range biases start
with one common part and one of each anchor's own, so that the filter learns both from what the
geometry shows and holds what it does not: an unobservable combination simply keeps its prior
covariance.

What blocks the way makes a range longer, never shorter. So

- an anchor that has read long for a while is believed less and less: its errors are of one piece;
- an anchor that has read short for a while speaks against the pose itself: odometry has failed
  (wheels spin, the robot was pushed), and the pose is doubted until the ranges agree again.

Each anchor's mean innovation is kept in `Estimate.memory`, so that an update stays a pure
function and late data can be put in their place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from tablerunner.errors import CovarianceError
from tablerunner.estimation.correction import Expected as Linearised
from tablerunner.estimation.correction import correct, expect
from tablerunner.estimation.estimator import (
    RANGE_SOURCE,
    EstimatorConfig,
    Measurement,
    Start,
)
from tablerunner.estimation.models.motion_model import input_noise, move, transport
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import (
    STANDING,
    Point3,
    predict_range,
    predict_ranges,
)
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    HEADING,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
    X,
    Y,
    state_names,
)
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import (
    Anchor,
    Estimate,
    HeadingSample,
    Innovation,
    Matrix,
    PoseSample,
    RangeSample,
    Vector,
)

LONG, SHORT = 'long for a while', 'short for a while'
"""Why a range was taken as it was: its anchor's mean innovation is no chance."""

CLIP = 4.0
"""One wild reading does not make an anchor's mean [standard deviations]."""


def bias_covariance(config: EstimatorConfig, count: int) -> Matrix:
    """Return the prior covariance of the range biases, shape (count, count)."""
    common = np.full((count, count), config.range_bias_common_std**2)
    return np.asarray(common + np.eye(count) * config.range_bias_std**2)


def range_variance(config: EstimatorConfig, sample: RangeSample) -> float:
    """Return the variance of a range [m^2], with what NLOS may add to it."""
    variance = sample.variance_m2 if sample.variance_m2 > 0.0 else config.default_range_std**2
    least = config.least_range_std * config.least_range_std
    if variance < least:
        variance = least
    probability = sample.nlos_probability
    if probability > 0.0:  # false for NaN
        variance += (probability * config.nlos_std) ** 2
    return variance


class Expected(NamedTuple):
    """What an anchor should read."""

    range_m: float
    variance: float  # [m^2], from the state's
    cross: Vector  # (n,), covariance of state and range


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
        self._places = {anchor.anchor_id: (anchor.position, i) for i, anchor in enumerate(anchors)}
        self._told_bias = {anchor.anchor_id: anchor.bias_m for anchor in anchors}
        self._size = RANGE_BIAS + 2 * len(anchors)
        self._biases = slice(RANGE_BIAS, RANGE_BIAS + len(anchors))
        self._scales = slice(RANGE_BIAS + len(anchors), self._size)
        self._calm = (0.0,) * len(anchors)
        self._usual_bias = math.hypot(config.range_bias_common_std, config.range_bias_std)
        walk = np.zeros(self._size)
        walk[GYRO_BIAS] = config.gyro_bias_walk**2
        walk[RANGE_DELAY] = config.range_delay_walk**2
        walk[self._biases] = config.range_bias_walk**2
        self._walk = np.diag(walk)  # for each second

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
        for index, deviation in (
            (SCALE, config.scale_std),
            (TURN_SCALE, config.turn_scale_std),
            (GYRO_BIAS, config.gyro_bias_std),
            (RANGE_DELAY, config.range_delay_std),
        ):
            covariance[index, index] = deviation**2
        if start.range_biases is not None and start.covariance is not None:
            mean[self._biases] = start.range_biases
            rows = np.r_[0:3, RANGE_BIAS : RANGE_BIAS + count]
            covariance[np.ix_(rows, rows)] = start.covariance
        else:
            covariance[:3, :3] = start.pose_covariance
            covariance[self._biases, self._biases] = bias_covariance(config, count)
        covariance[self._scales, self._scales] = np.eye(count) * config.range_scale_std**2
        _require_covariance(covariance)
        return Estimate(start.stamp, mean, covariance, memory=self._calm)

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        moved, by_state, by_input = move(estimate.mean, motion)
        noise = self._noise(estimate, motion, by_input)
        covariance = transport(estimate.covariance, by_state, noise)
        return Estimate(
            stamp, moved, covariance, twist_of(estimate, moved, motion), estimate.memory
        )

    def _noise(self, estimate: Estimate, motion: Motion, by_input: tuple[float, ...]) -> Matrix:
        """Return the process noise of a step, (n, n)."""
        config, dt_s = self.config, motion.dt_s
        noise: Matrix = self._walk * dt_s
        distance, turn = motion.distance_m, motion.turn_rad
        if distance == 0.0 and turn == 0.0:
            return noise  # wheels that stand are known to stand
        noise[SCALE, SCALE] = config.scale_walk**2 * abs(distance)
        noise[TURN_SCALE, TURN_SCALE] = config.turn_scale_walk**2 * abs(turn)
        input_noise(noise, by_input, *config.motion.variances(motion))
        if self._doubts(estimate):
            doubt = config.doubt_std**2 * dt_s
            noise[X, X] += doubt
            noise[Y, Y] += doubt
            noise[HEADING, HEADING] += config.doubt_turn_std**2 * dt_s
        return noise

    def _doubts(self, estimate: Estimate) -> bool:
        """Whether an anchor has read short for so long that the pose must be wrong."""
        if not estimate.memory or min(estimate.memory) > -self.config.doubt:
            return False
        variance = estimate.covariance
        return float(variance[X, X] + variance[Y, Y]) < self.config.doubt_limit**2

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a range or a pose, and what happened."""
        if isinstance(measurement, RangeSample):
            return self._update_range(estimate, measurement)
        if isinstance(measurement, HeadingSample):
            return self._update_heading(estimate, measurement)
        return self._update_pose(estimate, measurement)

    def update_ranges(
        self, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]]:
        """Return the estimate corrected by ranges of one instant, and what each of them did.

        Where none is out of the ordinary they are one measurement of m numbers, linearised at
        the estimate; the innovation of each is what those before it left open (the rows of the
        whitened innovation). Else each is judged and taken by itself, one after the other.
        """
        together = self._update_together(estimate, samples) if len(samples) > 1 else None
        if together is not None:
            return together
        innovations = []
        for sample in samples:
            estimate, innovation = self._update_range(estimate, sample)
            innovations.append(innovation)
        return estimate, tuple(innovations)

    def _update_together(
        self, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]] | None:
        """Return what `update_ranges` does if no range is out of the ordinary, else None."""
        config, memory = self.config, list(estimate.memory)
        places = [self._places[sample.anchor_id] for sample in samples]
        expected, slopes = predict_ranges(estimate.mean, places, self.lever_arm, estimate.twist)
        innovations = []
        cross = slopes.dot(estimate.covariance)
        spread = cross.dot(slopes.T)
        for row, sample in enumerate(samples):
            spread[row, row] += range_variance(config, sample)
            told = sample.range_m - self._told_bias[sample.anchor_id]
            innovations.append(told - expected[row])
        # LAPACK itself, for NumPy's wrappers take longer than the arithmetic, and so do names of
        # arguments: lower, clean, overwrite.
        root, fault = dpotrf(spread.T, 1, 1, 1)
        if fault:
            return None
        whiten, _ = dtrtri(root, 1)
        white = whiten.dot(innovations)
        scales = root.diagonal()
        open_ = (white * scales).reshape(-1, 1)
        variances = (scales * scales).reshape(-1, 1, 1)
        # Out of the loop: reading an attribute takes as long as the comparison.
        huber, gate, share = config.huber, config.gate, config.persistence_share
        low, high = -config.doubt, config.persistence
        found = []
        for row, deviation in enumerate(white.tolist()):
            sample, index = samples[row], places[row][1]
            persistent = memory[index]
            if not (-huber <= deviation <= huber and low < persistent < high):
                return None
            memory[index] = persistent + share * (deviation - persistent)
            found.append(
                Innovation(
                    sample.stamp,
                    RANGE_SOURCE,
                    sample.anchor_id,
                    True,
                    '',
                    open_[row],
                    variances[row],
                    deviation * deviation,
                    gate,
                )
            )
        gained = whiten.dot(cross)
        mean = white.dot(gained)
        mean += estimate.mean
        if not -math.pi < mean[HEADING] <= math.pi:
            mean[HEADING] = wrap(float(mean[HEADING]))
        # A product with its own transpose is symmetric to the last bit.
        covariance = gained.T.dot(gained)
        np.subtract(estimate.covariance, covariance, covariance)
        after = Estimate(samples[0].stamp, mean, covariance, estimate.twist, tuple(memory))
        return after, tuple(found)

    def _update_range(
        self, estimate: Estimate, sample: RangeSample
    ) -> tuple[Estimate, Innovation]:
        config = self.config
        index, anchor = self._anchors[sample.anchor_id]
        expected, variance, cross = self._expect(estimate, anchor, index)
        innovation = sample.range_m - anchor.bias_m - expected
        noise = range_variance(config, sample)
        spread = variance + noise
        deviations = innovation / math.sqrt(spread)
        memory = list(estimate.memory)
        persistent = memory[index]
        if persistent < -config.doubt and estimate.mean[RANGE_BIAS + index] > self._usual_bias:
            # What has been learned of this anchor was something in the way, which is gone.
            estimate = self._forget_bias(estimate, index)
            return self._update_range(estimate, sample)
        clipped = min(max(deviations, -CLIP), CLIP)
        memory[index] = persistent = persistent + config.persistence_share * (clipped - persistent)
        nis = deviations * deviations
        accepted, reason = nis <= config.gate, ''
        if accepted:
            weighed = spread
            if abs(deviations) > config.huber:
                # Huber: beyond the knee the pull stays constant, as if the noise were larger.
                weighed = spread * abs(deviations) / config.huber
                reason = 'weight reduced'
            if deviations > 0.0 and persistent > config.persistence:
                # So many readings share one error, and tell as little as one.
                weighed += spread * persistent * persistent * config.persistence_count
                reason = LONG
            elif persistent < -config.doubt:
                reason = SHORT
            mean = estimate.mean + cross * (innovation / weighed)
            if not -math.pi < mean[HEADING] <= math.pi:
                mean[HEADING] = wrap(float(mean[HEADING]))
            covariance = _without(estimate.covariance, cross, weighed)
            after = Estimate(sample.stamp, mean, covariance, estimate.twist, tuple(memory))
        else:
            reason = 'beyond the gate'
            after = estimate._replace(memory=tuple(memory))
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

    def _forget_bias(self, estimate: Estimate, index: int) -> Estimate:
        """Return the estimate with one anchor's range bias back at its prior."""
        row, mean, covariance = (
            RANGE_BIAS + index,
            estimate.mean.copy(),
            estimate.covariance.copy(),
        )
        mean[row] = 0.0
        covariance[row] = covariance[:, row] = 0.0
        covariance[row, row] = self._usual_bias**2
        memory = list(estimate.memory)
        memory[index] = 0.0
        return estimate._replace(mean=mean, covariance=covariance, memory=tuple(memory))

    def _expect(self, estimate: Estimate, anchor: Anchor, index: int) -> Expected:
        """Return what an anchor should read, linearised at the mean.

        A filter that spreads points instead overrides this and `_update_together`.
        """
        expected, jacobian = predict_range(
            estimate.mean, anchor.position, self.lever_arm, index, estimate.twist
        )
        cross = estimate.covariance.dot(jacobian)
        return Expected(expected, float(jacobian.dot(cross)), cross)

    def _update_heading(
        self, estimate: Estimate, sample: HeadingSample
    ) -> tuple[Estimate, Innovation]:
        innovation = np.array([wrap(sample.heading_rad - float(estimate.mean[HEADING]))])
        slope = np.zeros((1, self._size))
        slope[0, HEADING] = 1.0
        seen = expect(estimate.covariance, innovation, slope, np.array([[sample.variance]]))
        gate = self.config.heading_gate
        return self._taken(estimate, seen, sample.stamp, sample.source, gate)

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
        gate = self.config.pose_gate
        return self._taken(estimate, seen, sample.stamp, sample.source, gate)

    @staticmethod
    def _taken(
        estimate: Estimate, seen: Linearised, stamp: int, source: str, gate: float
    ) -> tuple[Estimate, Innovation]:
        accepted = seen.nis <= gate
        after = correct(estimate, seen, stamp) if accepted else estimate
        reason = '' if accepted else 'beyond the gate'
        return after, Innovation(
            stamp, source, '', accepted, reason, seen.innovation, seen.spread, seen.nis, gate
        )


def _without(covariance: Matrix, cross: Vector, spread: float) -> Matrix:
    """Return the covariance after a range, P - c c'/s, symmetric to the last bit.

    For the gain c/s of a single number Joseph's form (Sun 32) is this very matrix, and no range
    is weighed with less than `least_range_std`.
    """
    root = cross * (1.0 / math.sqrt(spread))
    # As a product of matrices: half the time of an outer product by broadcasting.
    return np.asarray(covariance - root.reshape(-1, 1).dot(root.reshape(1, -1)))


def twist_of(estimate: Estimate, moved: Vector, motion: Motion) -> tuple[float, float]:
    """Return forward speed [m/s] and turn rate [rad/s] of a step, scale errors taken off."""
    if motion.dt_s <= 0.0:
        return estimate.twist
    if motion.distance_m == 0.0 and motion.turn_rad == 0.0:
        return STANDING
    scale, turn_scale, gyro_bias = moved[SCALE : GYRO_BIAS + 1].tolist()
    return (
        (1.0 + scale) * motion.distance_m / motion.dt_s,
        (1.0 + turn_scale) * motion.turn_rad / motion.dt_s - gyro_bias,
    )


def _require_covariance(covariance: Matrix) -> None:
    if not np.all(np.isfinite(covariance)):
        raise CovarianceError('the covariance of the start is not finite')
    if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=1e-12):
        raise CovarianceError('the covariance of the start is not symmetric')
    if np.linalg.eigvalsh(covariance)[0] < -1e-9 * max(1.0, float(np.trace(covariance))):
        raise CovarianceError('the covariance of the start is not positive semi-definite')
