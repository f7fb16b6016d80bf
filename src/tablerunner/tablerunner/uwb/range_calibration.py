"""Linear calibration of one anchor's ranges against known distances (Sun 34-36)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.errors import GeometryError
from tablerunner.uwb import ranging
from tablerunner.uwb.clear_line import fit_clear_line

Array = NDArray[np.float64]

HUBER = 1.345
"""Residuals beyond this many standard deviations count less."""

_ROUNDS = 30
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True)
class RangeCalibration:
    """What an anchor's ranges read too long: raw = (1 + scale) true + bias.

    Attributes
    ----------
    bias_m : float
    scale : float
        Zero, with zero variance, where `scale_fitted` is false.
    covariance : ndarray, shape (2, 2)
        Of bias and scale.
    residual_std_m : float
        Standard deviation of one range about the line: what `range_std` should be.
    count : int
        Ranges used.
    shortest_m, longest_m : float
        True distances between which it holds.
    scale_fitted : bool
    rejected : float
        Share of the ranges that were left out for being blocked; 0 where none are.
    """

    bias_m: float
    scale: float
    covariance: Array
    residual_std_m: float
    count: int
    shortest_m: float
    longest_m: float
    scale_fitted: bool
    rejected: float = 0.0

    def apply(self, raw: ArrayLike) -> Array:
        """Return calibrated ranges [m] (Sun 36)."""
        return np.asarray(
            ranging.calibrated(np.asarray(raw, dtype=float), self.bias_m, self.scale)
        )

    def deviation(self, true: ArrayLike) -> Array:
        """Return the standard deviation that the calibration leaves at true distances [m]."""
        distance = np.asarray(true, dtype=float)
        variance = (
            self.covariance[0, 0]
            + 2.0 * distance * self.covariance[0, 1]
            + distance**2 * self.covariance[1, 1]
        )
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)) / (1.0 + self.scale))


def fit_calibration(
    true: ArrayLike,
    raw: ArrayLike,
    least_span: float = 2.0,
    robust: bool = True,
    blocked: bool = False,
) -> RangeCalibration:
    """Return the line through raw ranges over true distances, with its uncertainty.

    Parameters
    ----------
    true, raw : array_like, shape (k,)
        Known and measured distances [m]; pairs with a value that is not finite are left out.
    least_span : float
        Span of true distances [m] under which only a bias is fitted: the scale would be noise.
    robust : bool
        Weigh by Huber's function about a scale from the median absolute residual, so that
        a few blocked ranges hardly move the line.
    blocked : bool
        Whether up to half of the ranges may be blocked: the line of the others is found
        (`fit_clear_line`). Not for errors that are lopsided even in plain sight: it finds where
        most of them lie, not their mean.

    Raises
    ------
    GeometryError
        Shapes differ, a true distance is not positive, fewer than three pairs are left, or those
        that agree do not settle a line.
    """
    distance, measured = np.asarray(true, dtype=float), np.asarray(raw, dtype=float)
    if distance.shape != measured.shape or distance.ndim != 1:
        raise GeometryError(f'{distance.shape} true and {measured.shape} raw ranges do not match')
    sound = np.isfinite(distance) & np.isfinite(measured)
    distance, measured = distance[sound], measured[sound]
    if len(distance) < 3:
        raise GeometryError(f'{len(distance)} pairs of ranges are too few for a calibration')
    if not np.all(distance > 0.0):
        raise GeometryError('a true distance is not positive')
    fitted = bool(np.ptp(distance) >= least_span)
    # About the mean distance bias and scale are independent; the bias at zero follows from it.
    middle = float(distance.mean())
    design = np.column_stack([np.ones(len(distance)), distance - middle])[:, : 1 + fitted]
    error = measured - distance
    if blocked:
        line = fit_clear_line(design, error)
        return _calibration(
            line.values, line.covariance, line.std_m, distance, fitted, 1.0 - line.share
        )
    weight = np.ones(len(distance))
    values = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        matrix = design.T @ (weight[:, None] * design)
        new = np.linalg.solve(matrix, design.T @ (weight * error))
        settled = bool(np.all(np.abs(new - values) < 1e-9))
        values = new
        if settled or not robust:
            break
        size = np.abs(error - design @ values)
        sigma = max(_MAD_TO_SIGMA * float(np.median(size)), 1e-9)
        weight = np.minimum(1.0, HUBER * sigma / np.maximum(size, 1e-12))
    residual = error - design @ values
    spare = max(float(weight.sum()) - design.shape[1], 1.0)
    variance = float(np.sum(weight * residual**2)) / spare
    if robust:
        # The sandwich of an M-estimator: a residual in the linear part of Huber's function no
        # longer moves with the line (a full weight is exactly 1), but still pulls at it.
        full_weight = weight == 1.0
        try:
            inverse = np.linalg.inv(design.T @ (full_weight[:, None] * design))
        except np.linalg.LinAlgError:
            raise GeometryError('the ranges that agree are all of one distance') from None
        pulled = design.T @ ((weight * residual)[:, None] ** 2 * design)
        inner = inverse @ pulled @ inverse * len(distance) / max(len(distance) - 2, 1)
    else:
        inner = np.linalg.inv(design.T @ design) * variance
    return _calibration(values, inner, float(np.sqrt(variance)), distance, fitted)


def _calibration(
    values: Array,
    covariance: Array,
    std: float,
    distance: Array,
    fitted: bool,
    rejected: float = 0.0,
) -> RangeCalibration:
    """Return the calibration of a line about the mean distance: the bias is that at zero."""
    middle = float(distance.mean())
    full = np.zeros((2, 2))
    full[: len(values), : len(values)] = covariance
    to_zero = np.array([[1.0, -middle], [0.0, 1.0]]) if fitted else np.eye(2)
    scale = float(values[1]) if fitted else 0.0
    return RangeCalibration(
        float(values[0]) - scale * middle,
        scale,
        to_zero @ full @ to_zero.T,
        std,
        len(distance),
        float(distance.min()),
        float(distance.max()),
        fitted,
        rejected,
    )
