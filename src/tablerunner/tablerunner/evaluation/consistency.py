"""Whether an estimator's covariances tell the truth: NEES and NIS with two-sided bounds.

Bar-Shalom, Li, Kirubarajan 2001, section 5.4: the sum of n independent normalised squared errors
of m dimensions follows a chi-square distribution with n m degrees of freedom. Too small is as
wrong as too large.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from tablerunner.types import Innovation, Matrix, Vector


@dataclass(frozen=True, slots=True)
class Consistency:
    """Mean of normalised squared errors, and between what it should lie.

    Attributes
    ----------
    count : int
        Number of errors.
    dimensions : int
        Of all errors together (the degrees of freedom of their sum).
    mean : float
        Mean normalised squared error for each dimension; 1 when the covariance is right.
    low, high : float
        Two-sided bounds of `mean` for a consistent estimator with independent errors.
    """

    count: int
    dimensions: int
    mean: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the mean lies inside its bounds."""
        return self.low <= self.mean <= self.high


def chi_square_bounds(dimensions: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the two-sided bounds of a chi-square variable with so many degrees of freedom."""
    tail = 0.5 * (1.0 - probability)
    return float(chdtri(dimensions, 1.0 - tail)), float(chdtri(dimensions, tail))


def nees(errors: Matrix, covariances: Matrix) -> Vector:
    """Return the normalised estimation error squared of each row, e' P^-1 e.

    Parameters
    ----------
    errors : ndarray, shape (n, m)
        Estimate minus truth.
    covariances : ndarray, shape (n, m, m)
        Of the estimates; NaN comes out where one is singular.
    """
    errors = np.asarray(errors, dtype=float)
    values = np.full(len(errors), np.nan)
    for row, (error, covariance) in enumerate(zip(errors, covariances, strict=True)):
        try:
            values[row] = error @ np.linalg.solve(covariance, error)
        except np.linalg.LinAlgError:
            continue
    return values


def consistency(
    values: Iterable[float], dimensions: Iterable[int], probability: float = 0.95
) -> Consistency:
    """Judge normalised squared errors (NEES or NIS) by their mean.

    Parameters
    ----------
    values : iterable of float
        Normalised squared errors; those that are not finite are left out.
    dimensions : iterable of int
        Dimension of each.
    probability : float
        Of lying inside the bounds when the estimator is consistent.
    """
    pairs = [
        (value, size) for value, size in zip(values, dimensions, strict=True) if np.isfinite(value)
    ]
    total = sum(size for _, size in pairs)
    if not total:
        nothing = float('nan')
        return Consistency(0, 0, nothing, nothing, nothing)
    low, high = chi_square_bounds(total, probability)
    mean = sum(value for value, _ in pairs) / total
    return Consistency(len(pairs), total, float(mean), low / total, high / total)


@dataclass(frozen=True, slots=True)
class SourceSummary:
    """What became of the measurements of one source.

    Attributes
    ----------
    count : int
        Measurements that reached the estimator.
    accepted : float
        Share of them that changed the estimate, 0 to 1.
    nis : Consistency
        Of the accepted ones.
    """

    count: int
    accepted: float
    nis: Consistency


def summarize_innovations(innovations: Iterable[Innovation]) -> dict[str, SourceSummary]:
    """Return for each source the share of accepted measurements and their NIS.

    Those that never reached the estimator say nothing about it and are left out.
    """
    by_source: dict[str, list[Innovation]] = {}
    for item in innovations:
        if not item.considered:
            continue
        by_source.setdefault(item.source, []).append(item)
    return {
        source: SourceSummary(
            len(items),
            sum(item.accepted for item in items) / len(items),
            consistency(
                [item.nis for item in items if item.accepted],
                [max(len(item.innovation), 1) for item in items if item.accepted],
            ),
        )
        for source, items in sorted(by_source.items())
    }
