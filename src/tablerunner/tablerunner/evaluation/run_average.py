"""Whether normalised squared errors, averaged over runs, lie in their bounds at every step.

Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2: at one step the runs are independent, so that the
sum over them follows a chi-square distribution. Errors of neighbouring steps are not independent:
steps outside come in clusters, and the share inside varies from one set of seeds to another by
more than the number of steps suggests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from tablerunner.types import Matrix, Vector


@dataclass(frozen=True)
class RunAverage:
    """Normalised squared errors averaged over runs, for each dimension, step by step.

    Attributes
    ----------
    means : ndarray, shape (steps,)
        1 on average when the covariance is right; NaN where no run has an error.
    low, high : ndarray, shape (steps,)
        Two-sided bounds.
    """

    means: Vector
    low: Vector
    high: Vector

    @property
    def inside(self) -> float:
        """Share of the steps inside the bounds, of those that have errors; NaN without any."""
        known = np.isfinite(self.means)
        if not known.any():
            return float('nan')
        good = (self.means >= self.low) & (self.means <= self.high)
        return float(np.mean(good[known]))

    @property
    def mean(self) -> float:
        """Mean over all steps, for each dimension; NaN without any."""
        known = np.isfinite(self.means)
        return float(np.mean(self.means[known])) if known.any() else float('nan')


def run_average(values: Matrix, dimensions: int | Matrix, probability: float = 0.95) -> RunAverage:
    """Average over runs.

    Parameters
    ----------
    values : ndarray, shape (runs, steps)
        NEES or NIS; NaN where a run has none at a step.
    dimensions : int or ndarray, shape (runs, steps)
        Of each value.
    probability : float
        Of lying inside at a step when the estimator is consistent.
    """
    values = np.asarray(values, dtype=float)
    known = np.isfinite(values)
    degrees = np.where(known, np.broadcast_to(dimensions, values.shape), 0).sum(axis=0)
    tail = 0.5 * (1.0 - probability)
    with np.errstate(invalid='ignore', divide='ignore'):
        means = np.where(known, values, 0.0).sum(axis=0) / degrees
        low, high = (chdtri(degrees, share) / degrees for share in (1.0 - tail, tail))
    return RunAverage(np.asarray(means), np.asarray(low), np.asarray(high))
