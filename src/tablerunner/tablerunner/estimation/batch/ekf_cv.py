"""Sun's filter with constant velocity over arrays: `EkfCv` of many runs in one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.batch.estimate import BatchEstimate, BatchInnovation
from tablerunner.estimation.correction import correct_by_one
from tablerunner.estimation.ekf_cv import EkfCv, expect_distance, predict_moving
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.models.range_model import Point3
from tablerunner.odometry.batch import Motions, variances
from tablerunner.types import Anchor

Array = NDArray[np.float64]


class BatchEkfCv:
    """`EkfCv` of many runs; the equations are shared with it."""

    name = 'ekf_cv'

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self.config = config
        self._anchors = anchors
        self._lever_arm = lever_arm

    def start(self, start: Start, runs: int) -> BatchEstimate:
        """Return the first estimate of `runs` filters that begin alike, standing."""
        single = EkfCv(self.config, self._anchors, self._lever_arm)
        return BatchEstimate.of(single.start(start), runs)

    def predict(self, estimate: BatchEstimate, motions: Motions) -> BatchEstimate:
        """Return the estimates carried on by their motions, the velocities measured."""
        _, turned = variances(self.config.motion, motions)
        mean, covariance = predict_moving(
            self.config.sun, estimate.mean, estimate.covariance, motions, turned
        )
        return BatchEstimate(mean, covariance, estimate.twist, estimate.memory)

    def update_range(
        self,
        estimate: BatchEstimate,
        anchor: int,
        range_m: Array,
        variance_m2: float,  # noqa: ARG002 - it keeps its own
        nlos_probability: Array,  # noqa: ARG002
    ) -> tuple[BatchEstimate, BatchInnovation]:
        """Return the estimates corrected by a range each; parameters as for `BatchEkf`."""
        there = np.isfinite(range_m)
        place = self._anchors[anchor]
        distance, slope = expect_distance(estimate.mean, place.position, self._lever_arm)
        innovation = range_m - place.bias_m - distance
        mean, covariance, spread = correct_by_one(
            estimate.mean,
            estimate.covariance,
            innovation,
            slope,
            self.config.sun.range_variance,
            there,
        )
        after = BatchEstimate(mean, covariance, estimate.twist, estimate.memory)
        spread = np.where(there, spread, np.nan)
        return after, BatchInnovation(innovation, spread, innovation**2 / spread, there)
