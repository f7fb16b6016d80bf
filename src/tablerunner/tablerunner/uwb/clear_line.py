"""The line of the clear ranges among many that are blocked.

Blocked ranges are only ever too long, by a wall's or a person's amount that lasts while the robot
passes. They pull at an estimator that gives every residual some weight, as Huber's does: with a
seventh of the ranges blocked, biases come out some centimetres too large. Here three things keep
them out:

- The start is the line about which half of the ranges lie closest together (Rousseeuw 1984, least
  median of squares), found by scanning slopes: no random draws.
- The scale comes from residuals below the line alone, which no wall makes.
- Tukey's biweight takes residuals beyond `CUT` times that scale out altogether.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import GeometryError

Array = NDArray[np.float64]

CUT = 3.0
"""Residuals beyond this many standard deviations have no weight; at 3, clear ranges alone give a
standard error that is an eighth larger than by plain least squares."""

STEEPEST = 0.2
"""Largest slope that is looked for either way: no radio's scale is that far off."""

_SLOPES = 201
_START_RANGES = 2000  # more of them would not make a better start
_ROUNDS = 200
_MAD_TO_SIGMA = 1.4826
_CUT_NORMAL_STD = 0.98658  # standard deviation of a normal variable that is cut at 3
_LEAST_STD_M = 1e-6


@dataclass(frozen=True)
class ClearLine:
    """A line through errors of ranges.

    Attributes
    ----------
    values : ndarray, shape (p,)
        Of the columns of the design.
    covariance : ndarray, shape (p, p)
        Of `values`: the sandwich of an M-estimator.
    std_m : float
        Standard deviation of a clear range about the line.
    share : float
        Share of the ranges that have a weight.
    """

    values: Array
    covariance: Array
    std_m: float
    share: float


def fit_clear_line(design: Array, error: Array) -> ClearLine:
    """Return the line of the ranges that are not blocked.

    Parameters
    ----------
    design : ndarray, shape (k, p)
        Ones, and for p = 2 the true distance about its mean [m].
    error : ndarray, shape (k,)
        Measured minus true range [m]; more than half of them clear.

    Raises
    ------
    GeometryError
        The ranges that agree do not settle the line: they are all of one distance, or too few.
    """
    values = _start(design, error)
    for _ in range(_ROUNDS):
        residual = error - design @ values
        inside = 1.0 - (residual / (CUT * _spread(residual))) ** 2
        weight = np.where(inside > 0.0, inside, 0.0) ** 2
        try:
            new = np.linalg.solve(
                design.T @ (weight[:, None] * design), design.T @ (weight * error)
            )
        except np.linalg.LinAlgError:
            raise _unsettled() from None
        settled = bool(np.all(np.abs(new - values) < 1e-9))
        values = new
        if settled:
            break
    residual = error - design @ values
    spread = _spread(residual)
    square = (residual / (CUT * spread)) ** 2
    near = square < 1.0
    pull = np.where(near, residual * (1.0 - square) ** 2, 0.0)
    slope = np.where(near, (1.0 - square) * (1.0 - 5.0 * square), 0.0)
    count, columns = design.shape
    try:
        inverse = np.linalg.inv(design.T @ (slope[:, None] * design))
    except np.linalg.LinAlgError:
        raise _unsettled() from None
    if np.any(np.diag(inverse) <= 0.0) or int(near.sum()) <= columns:
        raise _unsettled()
    covariance = inverse @ (design.T @ (pull[:, None] ** 2 * design)) @ inverse
    below = residual[(residual < 0.0) & (residual > -CUT * spread)]
    std = float(np.sqrt(np.mean(below**2))) / _CUT_NORMAL_STD if len(below) else spread
    return ClearLine(
        values, covariance * count / max(count - columns, 1), std, float(np.mean(near))
    )


def _start(design: Array, error: Array) -> Array:
    """Return the line about which half of the errors lie in the narrowest band."""
    if len(error) > _START_RANGES:
        some = np.linspace(0, len(error) - 1, _START_RANGES).astype(int)
        design, error = design[some], error[some]
    half = max(-(-len(error) // 2), min(design.shape[1] + 1, len(error)))
    slopes = np.linspace(-STEEPEST, STEEPEST, _SLOPES) if design.shape[1] > 1 else np.zeros(1)
    sloping = design[:, 1] if design.shape[1] > 1 else np.zeros(len(error))
    left = np.sort(error - slopes[:, None] * sloping, axis=1)  # (slopes, k)
    width = left[:, half - 1 :] - left[:, : left.shape[1] - half + 1]
    row, first = np.unravel_index(int(np.argmin(width)), width.shape)
    middle = float(np.mean(left[row, first : first + half]))
    return np.array([middle, slopes[row]])[: design.shape[1]]


def _spread(residual: Array) -> float:
    below = residual[residual < 0.0]
    middle = float(np.median(-below)) if len(below) else 0.0
    return max(_MAD_TO_SIGMA * middle, _LEAST_STD_M)


def _unsettled() -> GeometryError:
    return GeometryError('the ranges that agree do not settle a line')
