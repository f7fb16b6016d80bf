"""The default estimator over arrays: `Ekf` of many runs in one call.

The same equations as in `estimation.ekf` and `estimation.models`, where they are explained. They
stand here once more because the single filter runs on plain floats, which is several times faster
for one robot and impossible for many; a property test holds both together to 1e-9.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.batch.estimate import BatchEstimate, BatchInnovation
from tablerunner.estimation.ekf import CLIP, Ekf
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.models.range_model import NEAREST_M, Point3
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    HEADING,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
    X,
    Y,
    range_scale,
)
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.batch import Motions, variances
from tablerunner.types import Anchor

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_POSE = HEADING + 1  # states that odometry moves


class _Expected(NamedTuple):
    range_m: Array  # (runs,)
    variance: Array  # (runs,), [m^2], from the state's
    cross: Array  # (runs, n), covariance of state and range


class _Step(NamedTuple):
    """What the Jacobian of a motion is made of; arrays of shape (runs,)."""

    dx: Array
    dy: Array
    by_scale_x: Array
    by_scale_y: Array
    told: Array
    drift_s: Array


class BatchEkf:
    """`Ekf` of many runs."""

    name = 'ekf'

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self.config = config
        self._anchors = anchors
        self._lever_arm = lever_arm
        self._single = Ekf(config, anchors, lever_arm)
        self._usual_bias = math.hypot(config.range_bias_common_std, config.range_bias_std)
        walk = np.zeros(RANGE_BIAS + 2 * len(anchors))
        walk[GYRO_BIAS] = config.gyro_bias_walk**2
        walk[RANGE_DELAY] = config.range_delay_walk**2
        walk[RANGE_BIAS : RANGE_BIAS + len(anchors)] = config.range_bias_walk**2
        self._walk = walk  # for each second

    def start(self, start: Start, runs: int) -> BatchEstimate:
        """Return the first estimate of `runs` filters that begin alike; see `Ekf.start`."""
        return BatchEstimate.of(self._single.start(start), runs)

    def predict(self, estimate: BatchEstimate, motions: Motions) -> BatchEstimate:
        """Return the estimates carried on by their motions."""
        mean, dt_s = estimate.mean, motions.dt_s
        distance, told = motions.distance_m, motions.turn_rad
        stands = motions.stands
        drift_s = np.where(stands, 0.0, dt_s)
        turn = (1.0 + mean[:, TURN_SCALE]) * told - mean[:, GYRO_BIAS] * drift_s
        course = mean[:, HEADING] + 0.5 * turn
        cos, sin = np.cos(course), np.sin(course)
        length = 1.0 + mean[:, SCALE]
        step_x, step_y = distance * cos, distance * sin
        dx, dy = length * step_x, length * step_y
        moved = mean.copy(order='K')
        moved[:, X] += dx
        moved[:, Y] += dy
        moved[:, HEADING] = _wrapped(mean[:, HEADING] + turn)
        covariance = _transport(estimate.covariance, _Step(dx, dy, step_x, step_y, told, drift_s))
        turned = 1.0 + mean[:, TURN_SCALE]
        by_input = (length * cos, length * sin, -0.5 * dy * turned, 0.5 * dx * turned, turned)
        self._add_noise(covariance, estimate, motions, by_input)
        return BatchEstimate(moved, covariance, _twist(estimate, moved, motions), estimate.memory)

    def _add_noise(
        self,
        covariance: Array,
        estimate: BatchEstimate,
        motions: Motions,
        by_input: tuple[Array, Array, Array, Array, Array],
    ) -> None:
        """Add the process noise of a step to covariances, (runs, n, n), in place.

        `by_input` is as of `models.motion_model.Moved`.
        """
        config, dt_s = self.config, motions.dt_s
        moves = ~motions.stands
        np.einsum('rii->ri', covariance)[...] += dt_s[:, None] * self._walk
        covariance[:, SCALE, SCALE] += config.scale_walk**2 * np.abs(motions.distance_m)
        covariance[:, TURN_SCALE, TURN_SCALE] += config.turn_scale_walk**2 * np.abs(
            motions.turn_rad
        )
        distance, turn = (moves * value for value in variances(config.motion, motions))
        gx, gy, ex, ey, turned = by_input
        covariance[:, X, X] += gx * gx * distance + ex * ex * turn
        covariance[:, Y, Y] += gy * gy * distance + ey * ey * turn
        _add_both(covariance, X, Y, gx * gy * distance + ex * ey * turn)
        turn = turn * turned
        _add_both(covariance, X, HEADING, ex * turn)
        _add_both(covariance, Y, HEADING, ey * turn)
        covariance[:, HEADING, HEADING] += turned * turn
        doubts = moves & self._doubts(estimate)
        if doubts.any():
            place = np.where(doubts, config.doubt_std**2 * dt_s, 0.0)
            covariance[:, X, X] += place
            covariance[:, Y, Y] += place
            covariance[:, HEADING, HEADING] += np.where(
                doubts, config.doubt_turn_std**2 * dt_s, 0.0
            )

    def _doubts(self, estimate: BatchEstimate) -> Flags:
        if not estimate.memory.shape[1]:
            return np.zeros(len(estimate.mean), dtype=bool)
        variance = estimate.covariance[:, X, X] + estimate.covariance[:, Y, Y]
        short = estimate.memory.min(axis=1) <= -self.config.doubt
        return np.asarray(short & (variance < self.config.doubt_limit**2))

    def update_range(
        self,
        estimate: BatchEstimate,
        anchor: int,
        range_m: Array,
        variance_m2: float,
        nlos_probability: Array,
    ) -> tuple[BatchEstimate, BatchInnovation]:
        """Return the estimates corrected by a range each, all to one anchor.

        Parameters
        ----------
        estimate : BatchEstimate
        anchor : int
            Index of the anchor.
        range_m : ndarray, shape (runs,)
            [m]; NaN where there is none: that run stays as it is.
        variance_m2 : float
            Of each range; 0 when not known.
        nlos_probability : ndarray, shape (runs,)
            NaN where not known.
        """
        config = self.config
        there = np.isfinite(range_m)
        estimate = self._forget_biases(estimate, anchor, there)
        expected, variance, cross = self._expect(estimate, anchor)
        innovation = range_m - self._anchors[anchor].bias_m - expected
        least = variance_m2 if variance_m2 > 0.0 else config.default_range_std**2
        likely = np.fmax(nlos_probability, 0.0)  # NaN says nothing
        noise = max(least, config.least_range_std**2) + (likely * config.nlos_std) ** 2
        spread = variance + noise
        known = innovation if there.all() else np.where(there, innovation, 0.0)
        deviations = known / np.sqrt(spread)
        size = np.abs(deviations)
        before = estimate.memory[:, anchor]
        clipped = np.minimum(np.maximum(deviations, -CLIP), CLIP)
        persistent = before + config.persistence_share * (clipped - before)
        memory = estimate.memory.copy(order='K')
        memory[:, anchor] = np.where(there, persistent, before)
        nis = innovation * innovation / spread
        accepted = there & (deviations * deviations <= config.gate)
        weight = np.maximum(size / config.huber, 1.0)
        long = (deviations > 0.0) & (persistent > config.persistence)
        if long.any():
            weight += np.where(long, persistent**2 * config.persistence_count, 0.0)
        share = accepted / (spread * weight)
        mean = estimate.mean + cross * (share * known)[:, None]
        mean[:, HEADING] = _wrapped(mean[:, HEADING])
        root = cross * np.sqrt(share)[:, None]
        covariance = root[:, :, None] * root[:, None, :]
        np.subtract(estimate.covariance, covariance, out=covariance)
        after = BatchEstimate(mean, covariance, estimate.twist, memory)
        return after, BatchInnovation(
            innovation, np.where(there, spread, np.nan), nis, np.asarray(accepted)
        )

    def _forget_biases(self, estimate: BatchEstimate, anchor: int, there: Flags) -> BatchEstimate:
        """Return the estimates, a bias at its prior where it was something in the way."""
        row, usual = RANGE_BIAS + anchor, self._usual_bias
        gone = there & (estimate.memory[:, anchor] < -self.config.doubt)
        gone &= estimate.mean[:, row] > usual
        if not gone.any():
            return estimate
        mean, covariance = estimate.mean.copy(order='K'), estimate.covariance.copy()
        memory = estimate.memory.copy(order='K')
        mean[gone, row] = 0.0
        covariance[gone, row] = 0.0
        covariance[gone, :, row] = 0.0
        covariance[gone, row, row] = usual**2
        memory[gone, anchor] = 0.0
        return BatchEstimate(mean, covariance, estimate.twist, memory)

    def _expect(self, estimate: BatchEstimate, index: int) -> _Expected:
        """Return what an anchor should read, linearised at the means; see `predict_range`."""
        mean, anchor = estimate.mean, self._anchors[index].position
        heading, delay = mean[:, HEADING], mean[:, RANGE_DELAY]
        speed, turn_rate = estimate.twist[:, 0], estimate.twist[:, 1]
        cos, sin = np.cos(heading), np.sin(heading)
        angle = -turn_rate * delay
        turned, across = np.cos(angle), np.sin(angle)
        arm_x = turned * self._lever_arm[0] - across * self._lever_arm[1]
        arm_y = across * self._lever_arm[0] + turned * self._lever_arm[1]
        ahead = arm_x - speed * delay
        tag_x, tag_y = cos * ahead - sin * arm_y, sin * ahead + cos * arm_y
        dx, dy = mean[:, X] + tag_x - anchor[0], mean[:, Y] + tag_y - anchor[1]
        distance = np.sqrt(dx * dx + dy * dy + (self._lever_arm[2] - anchor[2]) ** 2)
        bias, scale = RANGE_BIAS + index, range_scale(mean.shape[1]) + index
        grown = 1.0 + mean[:, scale]
        away = grown / np.where(distance > NEAREST_M, distance, np.inf)
        ux, uy = dx * away, dy * away
        along, aside = speed - turn_rate * arm_y, turn_rate * arm_x
        slopes = (
            (X, ux),
            (Y, uy),
            (HEADING, uy * tag_x - ux * tag_y),
            (
                RANGE_DELAY,
                -(ux * (cos * along - sin * aside) + uy * (sin * along + cos * aside)),
            ),
            (scale, distance),
        )
        cross = estimate.covariance[:, :, bias].copy(order='K')
        for column, slope in slopes:
            cross += estimate.covariance[:, :, column] * slope[:, None]
        variance = cross[:, bias].copy(order='K')
        for column, slope in slopes:
            variance += slope * cross[:, column]
        return _Expected(grown * distance + mean[:, bias], variance, cross)


def _wrapped(heading: Array) -> Array:
    """Return `wrap(heading)`; the common case, nothing to do, costs a fraction of it."""
    return heading if (np.abs(heading) < np.pi).all() else wrap(heading)


def _add_both(covariance: Array, row: int, column: int, value: Array) -> None:
    covariance[:, row, column] += value
    covariance[:, column, row] += value


def _transport(covariance: Array, step: _Step) -> Array:
    """Return F P F' of every run, F as in `models.motion_model.move`, shape (runs, n, n)."""
    moved: Array = covariance.copy(order='K')
    _turn_rows(moved, covariance, step)
    turned = moved[:, :_POSE].swapaxes(1, 2)  # (runs, n, 3)
    corner = turned[:, :_POSE].copy(order='K')
    _turn_rows(corner, turned, step)
    moved[:, _POSE:, :_POSE] = moved[:, :_POSE, _POSE:].swapaxes(1, 2)
    moved[:, :_POSE, :_POSE] = 0.5 * (corner + corner.swapaxes(1, 2))
    return moved


def _turn_rows(moved: Array, rows: Array, step: _Step) -> None:
    """Add (F - I) times rows, (runs, n, m), to the rows of the pose, in place."""
    turned = step.told[:, None] * rows[:, TURN_SCALE] - step.drift_s[:, None] * rows[:, GYRO_BIAS]
    middle = rows[:, HEADING] + 0.5 * turned  # the way is laid along the mean heading
    scaled = rows[:, SCALE]
    moved[:, X] += step.by_scale_x[:, None] * scaled - step.dy[:, None] * middle
    moved[:, Y] += step.by_scale_y[:, None] * scaled + step.dx[:, None] * middle
    moved[:, HEADING] += turned


def _twist(estimate: BatchEstimate, moved: Array, motions: Motions) -> Array:
    """Return forward speed and turn rate of a step, (runs, 2), scale errors taken off."""
    lasts = motions.dt_s > 0.0
    time = motions.dt_s if lasts.all() else np.where(lasts, motions.dt_s, 1.0)
    twist: Array = np.empty_like(estimate.twist)
    twist[:, 0] = (1.0 + moved[:, SCALE]) * motions.distance_m / time
    turn = (1.0 + moved[:, TURN_SCALE]) * motions.turn_rad / time
    twist[:, 1] = turn - moved[:, GYRO_BIAS]
    stands = motions.stands
    if stands.any():
        twist[stands] = 0.0
    if not lasts.all():
        twist[~lasts] = estimate.twist[~lasts]
    return twist
