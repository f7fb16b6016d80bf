"""Iterated EKFs on the same state and models as the `ekf`: plain, and damped.

`iekf` linearises ranges and poses anew at each result (Gauss-Newton on the maximum a posteriori),
`lm_iekf` damps the steps by Levenberg-Marquardt, so that none raises the cost (the UIEKF of the
ceiling-camera paper; formulas in `particles.iterated`). Gates, Huber's weight and what is made of
blocked anchors are the `ekf`'s own: it judges, then the measurement that it takes, with the noise
that it takes it with, is iterated. Where a measurement is linear all three are the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tablerunner.estimation.ekf import Ekf, range_variance
from tablerunner.estimation.estimator import EstimatorConfig
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3, predict_range, predict_ranges
from tablerunner.estimation.models.state import HEADING
from tablerunner.estimation.particles.iterated import (
    Array,
    Iteration,
    Look,
    Rows,
    covariance_of,
    update,
)
from tablerunner.estimation.particles.kernel import square_root
from tablerunner.geometry.angles import wrap
from tablerunner.types import Anchor, Estimate, Innovation, Matrix, PoseSample, RangeSample, Vector

STEPS = 20
"""At most; ranges from metres away take two or three."""

TOLERANCE = 1e-6


class Iekf(Ekf):
    """Iterated extended Kalman filter on odometry, ranges and poses."""

    name = 'iekf'
    iteration = Iteration(STEPS, damped=False, tolerance=TOLERANCE)

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        super().__init__(config, anchors, lever_arm)
        self._plain = Ekf(config, anchors, lever_arm)

    def _update_together(
        self, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]] | None:
        taken = super()._update_together(estimate, samples)
        if taken is None:
            return None
        after, innovations = taken
        noise = np.diag([range_variance(self.config, sample) for sample in samples])
        return self._iterated(estimate, after, self._ranges(estimate, samples), noise), innovations

    def _update_range(
        self, estimate: Estimate, sample: RangeSample
    ) -> tuple[Estimate, Innovation]:
        # Not through `self`: the `ekf` may begin again with a bias that it has forgotten.
        after, innovation = self._plain.update(estimate, sample)
        noise = self._noise_taken(estimate, after, sample) if innovation.accepted else None
        if noise is None:
            return after, innovation
        look = self._ranges(estimate, (sample,))
        return self._iterated(estimate, after, look, np.array([[noise]])), innovation

    def _update_pose(self, estimate: Estimate, sample: PoseSample) -> tuple[Estimate, Innovation]:
        after, innovation = super()._update_pose(estimate, sample)
        if not innovation.accepted:
            return after, innovation
        rows = len(innovation.innovation)
        measured = np.array([sample.pose.x, sample.pose.y, sample.pose.heading])[:rows]

        def look(states: Matrix, _rows: Rows) -> tuple[Matrix, Array]:
            place, along = predict_position(states[0], sample.point)
            offset, slope = np.empty((1, rows)), np.zeros((1, rows, self._size))
            offset[0, :2], slope[0, :2] = measured[:2] - place, along
            if rows == 3:
                offset[0, 2] = wrap(float(measured[2] - states[0, HEADING]))
                slope[0, 2, HEADING] = 1.0
            return offset, slope

        noise = sample.covariance[:rows, :rows]
        return self._iterated(estimate, after, look, noise), innovation

    def _noise_taken(
        self, estimate: Estimate, after: Estimate, sample: RangeSample
    ) -> float | None:
        """Return the variance that the `ekf` took a range with; None if it hardly counted.

        Its covariance fell by c c'/s, with c the covariance of state and range.
        """
        index, anchor = self._anchors[sample.anchor_id]
        _, slope = predict_range(
            estimate.mean, anchor.position, self.lever_arm, index, estimate.twist
        )
        cross = estimate.covariance @ slope
        before = np.diagonal(estimate.covariance)
        fallen = before - np.diagonal(after.covariance)
        row = int(np.argmax(np.abs(cross)))
        if fallen[row] <= 1e-9 * before[row] or np.any(fallen < -1e-9 * before):
            return None  # nothing to iterate, or a bias was forgotten first
        return float(cross[row] ** 2 / fallen[row] - slope @ cross)

    def _ranges(self, estimate: Estimate, samples: Sequence[RangeSample]) -> Look:
        found = [self._anchors[sample.anchor_id] for sample in samples]
        places = [(anchor.position, index) for index, anchor in found]
        measured = np.array(
            [s.range_m - anchor.bias_m for s, (_, anchor) in zip(samples, found, strict=True)]
        )

        def look(states: Matrix, _rows: Rows) -> tuple[Matrix, Array]:
            expected, slopes = predict_ranges(states[0], places, self.lever_arm, estimate.twist)
            return (measured - np.array(expected))[None], slopes[None]

        return look

    def _iterated(self, before: Estimate, after: Estimate, look: Look, noise: Matrix) -> Estimate:
        """Return the estimate at the maximum a posteriori; all else as the `ekf` left it."""
        root = square_root(before.covariance)[None]
        updated = update(before.mean[None], root, look, noise, self.iteration)
        mean: Vector = updated.mean[0]
        mean[HEADING] = wrap(float(mean[HEADING]))
        covariance = covariance_of(root, updated)[0]
        covariance = 0.5 * (covariance + covariance.T)
        return Estimate(after.stamp, mean, covariance, after.twist, after.memory)


class LmIekf(Iekf):
    """The same with Levenberg-Marquardt damping."""

    name = 'lm_iekf'
    iteration = Iteration(STEPS, damped=True, tolerance=TOLERANCE)
