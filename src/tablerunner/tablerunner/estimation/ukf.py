"""An unscented Kalman filter on the same state and models as the `ekf`.

Where the EKF linearises, this one moves sigma points (filterpy's) through motion and range models
and takes their mean and covariance. Noise of odometry enters additively, as there; poses are
linear measurements and corrected as there; so are gate, robust weight and start.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tablerunner.estimation.ekf import Ekf, Expected, twist_of
from tablerunner.estimation.estimator import EstimatorConfig
from tablerunner.estimation.models.motion_model import move, move_many
from tablerunner.estimation.models.range_model import Point3, predict_range_many
from tablerunner.estimation.models.state import HEADING
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, Innovation, Matrix, RangeSample


class Ukf(Ekf):
    """Unscented Kalman filter on odometry, ranges and poses."""

    name = 'ukf'

    def __init__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        # Brings scipy.stats with it, half of what a node takes to start: only where it is needed.
        from filterpy.kalman import MerweScaledSigmaPoints

        super().__init__(config, anchors, lever_arm)
        # Without weight in the middle: all weights are positive, so that no covariance can become
        # negative; the points lie root(n) standard deviations away.
        self._points = MerweScaledSigmaPoints(
            self._size, alpha=1.0, beta=0.0, kappa=0.0, sqrt_method=_root
        )

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        moved = move_many(self._spread(estimate), motion)
        mean = self._points.Wm @ moved
        offset = moved - mean
        covariance = (self._points.Wc[:, None] * offset).T @ offset
        covariance += self._noise(estimate, motion, move(estimate.mean, motion).by_input)
        mean[HEADING] = wrap(float(mean[HEADING]))
        covariance = 0.5 * (covariance + covariance.T)
        return Estimate(stamp, mean, covariance, twist_of(estimate, mean, motion), estimate.memory)

    def _expect(self, estimate: Estimate, anchor: Anchor, index: int) -> Expected:
        points = self._spread(estimate)
        ranges = predict_range_many(points, anchor.position, self.lever_arm, index, estimate.twist)
        expected = float(self._points.Wm @ ranges)
        weighted = self._points.Wc * (ranges - expected)
        cross = weighted @ (points - estimate.mean)
        return Expected(expected, float(weighted @ (ranges - expected)), cross)

    def _update_together(
        self,
        estimate: Estimate,  # noqa: ARG002 - as the `ekf` has it
        samples: Sequence[RangeSample],  # noqa: ARG002
    ) -> tuple[Estimate, tuple[Innovation, ...]] | None:
        return None  # always one after the other

    def _spread(self, estimate: Estimate) -> Matrix:
        """Return the sigma points, shape (2 n + 1, n); headings not wrapped."""
        return np.asarray(self._points.sigma_points(estimate.mean, estimate.covariance))


def _root(covariance: Matrix) -> Matrix:
    """Return the symmetric square root; states without variance are no trouble to it."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
