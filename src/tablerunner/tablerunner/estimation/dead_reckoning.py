"""Odometry carried into the map, never corrected: what the other estimators must beat."""

from __future__ import annotations

from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.estimator import EstimatorConfig, Measurement, RangeByRange, Start
from tablerunner.estimation.models.range_model import Point3
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, Innovation, RangeSample


class DeadReckoning(RangeByRange):
    """Predicts as the EKF does, takes no measurement."""

    name = 'dead_reckoning'
    takes_positions = False

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self._filter = Ekf(config, anchors, lever_arm)
        self.state_names = self._filter.state_names

    def start(self, start: Start) -> Estimate:
        """Return the first estimate; errors as for `Ekf.start`."""
        return self._filter.start(start)

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        return self._filter.predict(estimate, motion, stamp)

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate as it was; the innovation says what the measurement would be."""
        _, innovation = self._filter.update(estimate, measurement)
        key = measurement.anchor_id if isinstance(measurement, RangeSample) else ''
        return estimate, Innovation(
            measurement.stamp,
            innovation.source,
            key,
            False,
            'dead reckoning takes no measurements',
            innovation.innovation,
            innovation.covariance,
            innovation.nis,
            innovation.gate,
        )
