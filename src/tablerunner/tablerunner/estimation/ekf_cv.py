"""Sun's extended Kalman filter on position and velocity with range measurements (Sun 38-48).

State: x, y, heading, vx, vy (the robot stays on the floor, so that the paper's z and vz are
known). Between measurements the velocity is constant but for its process noise (39, 44, 45); at
each step odometry measures it: the displacement over the time (42) along odometry's heading, which
is never corrected. Ranges are corrections of one row each, in Joseph's form (32 for 48).
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.correction import correct, expect
from tablerunner.estimation.estimator import (
    RANGE_SOURCE,
    EstimatorConfig,
    Measurement,
    RangeByRange,
    Start,
    no_use,
)
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import (
    Anchor,
    Estimate,
    HeadingSample,
    Innovation,
    RangeSample,
    Vector,
)

_SIZE = 5
_STILL_M_S = 1.0  # deviation of each velocity at the start: any speed of a robot indoors
_NEAREST_M = 1e-6


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
        dt = motion.dt_s
        if dt <= 0.0:
            return Estimate(stamp, estimate.mean, estimate.covariance)
        direction = float(estimate.mean[2]) + 0.5 * motion.turn_rad
        carry = np.eye(_SIZE)
        carry[0, 3] = carry[1, 4] = dt
        mean = carry @ estimate.mean
        mean[2] = wrap(float(estimate.mean[2]) + motion.turn_rad)
        _, turned = self.config.motion.variances(motion)
        # White acceleration of density q: the exact integral over the step.
        density = self.config.sun.acceleration_density
        noise = np.zeros((_SIZE, _SIZE))
        noise[0, 0] = noise[1, 1] = density * dt**3 / 3.0
        noise[0, 3] = noise[3, 0] = noise[1, 4] = noise[4, 1] = density * dt**2 / 2.0
        noise[3, 3] = noise[4, 4] = density * dt
        noise[2, 2] = turned
        moved = Estimate(stamp, mean, carry @ estimate.covariance @ carry.T + noise)
        speed = motion.distance_m / dt
        told = speed * np.array([math.cos(direction), math.sin(direction)])
        slope = np.zeros((2, _SIZE))
        slope[0, 3] = slope[1, 4] = 1.0
        # Weighed by the time it stands for: ten readings a second tell as much as fifty.
        variance = self.config.sun.velocity_variance / dt
        seen = expect(moved.covariance, told - mean[3:5], slope, np.eye(2) * variance)
        return correct(moved, seen, stamp)

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a range or a position (Sun 46, 47, 32)."""
        if isinstance(measurement, HeadingSample):
            return no_use(estimate, measurement, "the heading is odometry's")
        if isinstance(measurement, RangeSample):
            anchor = self._anchors[measurement.anchor_id]
            distance, slope = self._distance(estimate.mean, anchor)
            innovation = np.array([measurement.range_m - anchor.bias_m - distance])
            noise = np.array([[self.config.sun.range_variance]])
            source, key = RANGE_SOURCE, measurement.anchor_id
        else:
            place, slope = predict_position(estimate.mean, measurement.point)
            slope[:, 2] = 0.0  # the heading is odometry's
            innovation = np.array([measurement.pose.x, measurement.pose.y]) - place
            noise = measurement.covariance[:2, :2]
            source, key = measurement.source, ''
        seen = expect(estimate.covariance, innovation, slope, noise)
        return correct(estimate, seen, measurement.stamp), Innovation(
            measurement.stamp, source, key, True, '', innovation, seen.spread, seen.nis, math.inf
        )

    def _distance(self, mean: Vector, anchor: Anchor) -> tuple[float, Vector]:
        """Return the distance to an anchor (Sun 38) and its slope, (1, 5)."""
        place, _ = predict_position(mean, self._lever_arm[:2])
        dx, dy = place[0] - anchor.position[0], place[1] - anchor.position[1]
        distance = math.hypot(dx, dy, self._lever_arm[2] - anchor.position[2])
        slope = np.zeros((1, _SIZE))
        if distance > _NEAREST_M:
            slope[0, :2] = dx / distance, dy / distance
        return distance, slope
