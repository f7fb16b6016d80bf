"""Dynamic dimension fusion (Liu et al. 2023): positions correct what the motion lets them.

State: as in the `ekf`, without range biases. Speed and turn rate choose the dimension:

- straight on (fast, hardly turning): one, across the heading. The correction reaches the heading
  through its correlation with the place; the distance is left to the wheels.
- in a turn (slow, turning fast): two; they correct place, heading and distance scale.
- else: none. Dead reckoning goes on.

The paper describes the corrections in words; here both are Kalman corrections. The band between
the two regimes (Liu: 0.1-0.15 m/s, 0.03-0.65 rad/s) is taken as "else".
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from tablerunner.estimation.correction import correct, expect
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.estimator import (
    EstimatorConfig,
    Measurement,
    RangeByRange,
    Start,
    no_use,
)
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.models.state import BASE_NAMES, SCALE
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, Innovation, PoseSample


class Dimension(Enum):
    """How many directions of a position are used."""

    NONE = 0
    ACROSS = 1
    BOTH = 2


class Ddf(RangeByRange):
    """Dynamic dimension fusion of odometry and positions."""

    name = 'ddf'
    takes_positions = True
    state_names = BASE_NAMES

    def __init__(
        self,
        config: EstimatorConfig,
        anchors: tuple[Anchor, ...],  # noqa: ARG002 - all estimators are made alike
        lever_arm: Point3,
    ) -> None:
        self.config = config
        self._filter = Ekf(config, (), lever_arm)

    def start(self, start: Start) -> Estimate:
        """Return the first estimate; errors as for `Ekf.start`."""
        return self._filter.start(Start(start.stamp, start.pose, start.pose_covariance))

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        return self._filter.predict(estimate, motion, stamp)

    def dimension(self, estimate: Estimate) -> Dimension:
        """Return how many directions of a position would now be used."""
        config = self.config.ddf
        speed, turn_rate = (abs(value) for value in estimate.twist)
        if speed > config.straight_speed and turn_rate < config.straight_turn_rate:
            return Dimension.ACROSS
        if speed < config.turn_speed and turn_rate > config.turn_rate:
            return Dimension.BOTH
        return Dimension.NONE

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a position, and what happened."""
        if not isinstance(measurement, PoseSample):
            return no_use(estimate, measurement, 'ddf takes positions only')
        dimension = self.dimension(estimate)
        if dimension is Dimension.NONE:
            return no_use(estimate, measurement, 'neither straight on nor in a turn')
        place, slope = predict_position(estimate.mean, measurement.point)
        innovation = np.array([measurement.pose.x, measurement.pose.y]) - place
        noise = measurement.covariance[:2, :2] + np.eye(2) * self.config.ddf.position_std**2
        if dimension is Dimension.ACROSS:
            heading = float(estimate.mean[2])
            across = np.array([[-math.sin(heading), math.cos(heading)]])
            innovation, slope, noise = (
                across @ innovation,
                across @ slope,
                across @ noise @ across.T,
            )
        seen = expect(estimate.covariance, innovation, slope, noise)
        gate = self.config.ddf.gate
        accepted = seen.nis <= gate
        after = estimate
        if accepted:
            after = correct(estimate, seen, measurement.stamp)
            if dimension is Dimension.ACROSS:
                # What lies across says nothing of how far the wheels went.
                after.mean[SCALE] = estimate.mean[SCALE]
        return after, Innovation(
            measurement.stamp,
            measurement.source,
            '',
            accepted,
            '' if accepted else 'beyond the gate',
            innovation,
            seen.spread,
            seen.nis,
            gate,
        )
