"""Sun's extended Kalman filter on position and velocity with range measurements (Sun 38-48).

State: x, y, heading, vx, vy (the robot stays on the floor, so that the paper's z and vz are
known). Between measurements the velocity is constant but for its process noise (39, 44, 45); at
each step odometry measures it: the displacement over the time (42) along odometry's heading, which
is never corrected. Ranges are corrections of one row each, in Joseph's form (32 for 48).
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.correction import correct, correct_by_one, correct_state, expect
from tablerunner.estimation.estimator import (
    RANGE_SOURCE,
    EstimatorConfig,
    Measurement,
    RangeByRange,
    Start,
    SunConfig,
    no_use,
)
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.batch import Motions
from tablerunner.odometry.motion import Motion
from tablerunner.types import (
    Anchor,
    Estimate,
    HeadingSample,
    Innovation,
    Matrix,
    RangeSample,
    Vector,
)

X, Y, HEADING, VX, VY = range(5)
_SIZE = 5
_STILL_M_S = 1.0  # deviation of each velocity at the start: any speed of a robot indoors
_NEAREST_M = 1e-6


def predict_moving(
    config: SunConfig,
    mean: Matrix,
    covariance: Matrix,
    motion: Motion | Motions,
    turn_variance: float | Vector,
) -> tuple[Matrix, Matrix]:
    """Return means and covariances after a step (Sun 44, 45), the velocity measured (42).

    Parameters
    ----------
    config : SunConfig
    mean : ndarray, shape (..., 5)
    covariance : ndarray, shape (..., 5, 5)
    motion : Motion or Motions
        Odometry over the step. A step of no time changes nothing.
    turn_variance : float or ndarray, shape (...)
        Of the turn [rad^2].
    """
    dt = np.asarray(motion.dt_s)
    direction = mean[..., HEADING] + 0.5 * motion.turn_rad
    moved, spread = mean.copy(order='K'), covariance.copy(order='K')
    moved[..., X : Y + 1] += dt[..., None] * mean[..., VX:]
    moved[..., HEADING] = wrap(np.asarray(mean[..., HEADING] + motion.turn_rad))
    spread[..., X : Y + 1, :] += dt[..., None, None] * spread[..., VX:, :]
    spread[..., :, X : Y + 1] += dt[..., None, None] * spread[..., :, VX:]
    # White acceleration of density q: the exact integral over the step.
    density = config.acceleration_density
    for place, velocity in ((X, VX), (Y, VY)):
        spread[..., place, place] += density * dt**3 / 3.0
        spread[..., place, velocity] += density * dt**2 / 2.0
        spread[..., velocity, place] += density * dt**2 / 2.0
        spread[..., velocity, velocity] += density * dt
    spread[..., HEADING, HEADING] += turn_variance
    lasts = dt > 0.0
    time = np.where(lasts, dt, 1.0)
    speed = motion.distance_m / time
    # Weighed by the time it stands for: ten readings a second tell as much as fifty. Noise of
    # both axes is independent, so that one can be taken after the other.
    for velocity, told in ((VX, speed * np.cos(direction)), (VY, speed * np.sin(direction))):
        innovation = np.asarray(told - moved[..., velocity])
        moved, spread, _ = correct_state(
            moved, spread, innovation, velocity, config.velocity_variance / time, lasts
        )
    return moved, spread


def expect_distance(mean: Matrix, anchor: Point3, lever_arm: Point3) -> tuple[Vector, Matrix]:
    """Return distances to an anchor (Sun 38), shape (...) [m], and their slopes, (..., 5)."""
    cos, sin = np.cos(mean[..., HEADING]), np.sin(mean[..., HEADING])
    dx = mean[..., X] + cos * lever_arm[0] - sin * lever_arm[1] - anchor[0]
    dy = mean[..., Y] + sin * lever_arm[0] + cos * lever_arm[1] - anchor[1]
    distance = np.sqrt(dx * dx + dy * dy + (lever_arm[2] - anchor[2]) ** 2)
    slope = np.zeros_like(mean)
    far = distance > _NEAREST_M
    safe = np.where(far, distance, 1.0)
    slope[..., X] = np.where(far, dx / safe, 0.0)
    slope[..., Y] = np.where(far, dy / safe, 0.0)
    return distance, slope


class EkfCv(RangeByRange):
    """Extended Kalman filter with constant velocity on ranges and positions."""

    name = 'ekf_cv'
    takes_positions = False
    state_names = ('x', 'y', 'heading', 'vx', 'vy')

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self.config = config
        self._lever_arm = lever_arm
        self._anchors = {anchor.anchor_id: anchor for anchor in anchors}

    def start(self, start: Start) -> Estimate:
        """Return the first estimate: the given pose, standing."""
        mean, covariance = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
        mean[:3] = start.pose
        covariance[:3, :3] = start.pose_covariance
        covariance[3, 3] = covariance[4, 4] = _STILL_M_S**2
        return Estimate(start.stamp, mean, covariance)

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` (Sun 44, 45), its velocity measured (42)."""
        if motion.dt_s <= 0.0:
            return estimate._replace(stamp=stamp)
        _, turned = self.config.motion.variances(motion)
        mean, covariance = predict_moving(
            self.config.sun, estimate.mean, estimate.covariance, motion, turned
        )
        return estimate._replace(stamp=stamp, mean=mean, covariance=covariance)

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a range or a position (Sun 46, 47, 32)."""
        if isinstance(measurement, HeadingSample):
            return no_use(estimate, measurement, "the heading is odometry's")
        if isinstance(measurement, RangeSample):
            return self._update_range(estimate, measurement)
        place, slope = predict_position(estimate.mean, measurement.point)
        slope[:, HEADING] = 0.0  # the heading is odometry's
        innovation = np.array([measurement.pose.x, measurement.pose.y]) - place
        seen = expect(estimate.covariance, innovation, slope, measurement.covariance[:2, :2])
        return correct(estimate, seen, measurement.stamp), Innovation(
            measurement.stamp,
            measurement.source,
            '',
            True,
            '',
            innovation,
            seen.spread,
            seen.nis,
            math.inf,
        )

    def _update_range(
        self, estimate: Estimate, sample: RangeSample
    ) -> tuple[Estimate, Innovation]:
        anchor = self._anchors[sample.anchor_id]
        distance, slope = expect_distance(estimate.mean, anchor.position, self._lever_arm)
        innovation = np.asarray(sample.range_m - anchor.bias_m - distance)
        mean, covariance, spread = correct_by_one(
            estimate.mean,
            estimate.covariance,
            innovation,
            slope,
            self.config.sun.range_variance,
        )
        after = estimate._replace(stamp=sample.stamp, mean=mean, covariance=covariance)
        return after, Innovation(
            sample.stamp,
            RANGE_SOURCE,
            sample.anchor_id,
            True,
            '',
            innovation[None],
            spread[None, None],
            float(innovation**2 / spread),
            math.inf,
        )
