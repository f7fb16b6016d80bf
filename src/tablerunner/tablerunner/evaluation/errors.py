"""Errors of an estimated path against the truth, in the frame they are given in.

No alignment takes place: the estimate claims poses in map, and is judged there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.evaluation.truth import Stamps, Truth
from tablerunner.types import Matrix, Vector


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Size of the position errors [m] and of the heading errors [rad].

    Attributes
    ----------
    count : int
        Times at which estimate and truth were compared; with none, all figures are NaN.
    rmse, mean, max, final : float
        Root mean square, mean, greatest and last distance to the truth [m].
    heading_rmse : float
        Root mean square of the heading error [rad]; NaN where the truth has no heading.
    """

    count: int
    rmse: float
    mean: float
    max: float
    final: float
    heading_rmse: float = float('nan')


@dataclass(frozen=True)
class ErrorSeries:
    """Errors over time; all arrays have one row for each time that has a truth.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Times [ns].
    errors : ndarray, shape (n, 3)
        Estimate minus truth: x, y [m], heading in [-pi, pi] [rad] (NaN where it is unknown).
    covariances : ndarray, shape (n, 3, 3)
        What the estimator believed of its error.
    """

    stamps: Stamps
    errors: Matrix
    covariances: Matrix

    @property
    def distances(self) -> Vector:
        """Distance between estimate and truth, shape (n,) [m]."""
        return np.hypot(self.errors[:, 0], self.errors[:, 1])

    def since(self, stamp: int) -> ErrorSeries:
        """Return the errors from a time [ns] on."""
        rows = self.stamps >= stamp
        return ErrorSeries(self.stamps[rows], self.errors[rows], self.covariances[rows])

    def summary(self) -> ErrorSummary:
        """Return the size of the errors."""
        if not len(self.stamps):
            nothing = float('nan')
            return ErrorSummary(0, nothing, nothing, nothing, nothing)
        distances = self.distances
        headings = self.errors[:, 2][np.isfinite(self.errors[:, 2])]
        return ErrorSummary(
            len(distances),
            float(np.sqrt(np.mean(distances**2))),
            float(np.mean(distances)),
            float(np.max(distances)),
            float(distances[-1]),
            float(np.sqrt(np.mean(headings**2))) if len(headings) else float('nan'),
        )


def compare(
    stamps: Stamps, poses: Matrix, truth: Truth, covariances: Matrix | None = None
) -> ErrorSeries:
    """Return the errors of a path at all its times that have a truth.

    Parameters
    ----------
    stamps : ndarray of int64, shape (n,)
        Times of the estimates [ns].
    poses : ndarray, shape (n, 3)
        Estimated x, y [m], heading [rad] of base_link in map.
    truth : Truth
        True poses of base_link in map.
    covariances : ndarray, shape (n, 3, 3), optional
        What the estimator believed; zeros when not given.
    """
    stamps = np.asarray(stamps, dtype=np.int64)
    poses = np.asarray(poses, dtype=float).reshape(-1, 3)
    if covariances is None:
        covariances = np.zeros((len(stamps), 3, 3))
    positions, headings = truth.at(stamps)
    errors = np.empty((len(stamps), 3))
    errors[:, :2] = poses[:, :2] - positions
    turn = poses[:, 2] - headings
    errors[:, 2] = np.arctan2(np.sin(turn), np.cos(turn))
    known = np.isfinite(positions).all(axis=1)
    return ErrorSeries(stamps[known], errors[known], np.asarray(covariances)[known])
