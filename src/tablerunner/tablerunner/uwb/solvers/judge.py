"""The end of every solver: from positions to a fix, refusing what the geometry leaves open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.fix import FixState, PositionFix

_NEAREST_M = 1e-9  # closer, an anchor has no direction
_MIN_DETERMINANT = 1e-6  # of the normal matrix, over its squared trace: below it one way is open


def judge(
    epochs: Epochs,
    position: Array,
    covariance: Array,
    used: NDArray[np.bool_],
    state: NDArray[np.int8],
) -> PositionFix:
    """Return the fix with residuals and dilution; NaN wherever an epoch has no answer.

    Parameters
    ----------
    position : ndarray, shape (m, 2)
    covariance : ndarray, shape (m, 2, 2)
    used : ndarray of bool, shape (m, n)
        Ranges that went into the position.
    state : ndarray of int8, shape (m,)
        What the solver says of each epoch; a solved one whose position or covariance is not
        finite becomes AMBIGUOUS.
    """
    sound = np.isfinite(position).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    state = np.where((state == FixState.SOLVED) & ~sound, FixState.AMBIGUOUS, state)
    solved = state == FixState.SOLVED
    place = np.where(solved[:, None], position, np.nan)
    dx = place[:, 0, None] - epochs.anchors[:, 0]
    dy = place[:, 1, None] - epochs.anchors[:, 1]
    predicted = np.sqrt(dx**2 + dy**2 + epochs.height**2)
    squares = np.where(used, (predicted - epochs.ranges) ** 2, 0.0)
    rms = np.sqrt(squares.sum(axis=1) / np.maximum(used.sum(axis=1), 1))
    chi_square = np.sum(squares / epochs.std**2, axis=1)
    return PositionFix(
        place,
        np.where(solved[:, None, None], covariance, np.nan),
        used,
        rms,
        chi_square,
        _dilution(dx, dy, predicted, used),
        state.astype(np.int8),
    )


def gdop(anchors: Array, position: Array, tag_height: float) -> Array:
    """Return the geometric dilution of precision of a plane fix from all anchors.

    sqrt(trace((J'J)^-1)), with J the unit vectors from the anchors to the tag, in three
    dimensions, of which the plane part counts.

    Parameters
    ----------
    anchors : ndarray, shape (n, 3)
    position : ndarray, shape (m, 2)

    Returns
    -------
    ndarray, shape (m,)
        Position error [m] per metre of range error; inf where nothing is determined.
    """
    dx = position[:, 0, None] - anchors[:, 0]
    dy = position[:, 1, None] - anchors[:, 1]
    predicted = np.sqrt(dx**2 + dy**2 + (anchors[:, 2] - tag_height) ** 2)
    return _dilution(dx, dy, predicted, np.ones(predicted.shape, dtype=bool))


def inverse_normal(a: Array, b: Array, d: Array) -> Array:
    """Return the inverses of m matrices [[a, b], [b, d]], NaN where a direction is open."""
    determinant = a * d - b * b
    with np.errstate(invalid='ignore', divide='ignore'):
        safe = np.where(determinant > _MIN_DETERMINANT * (a + d) ** 2, determinant, np.nan)
        covariance = np.empty((len(a), 2, 2))
        covariance[:, 0, 0], covariance[:, 1, 1] = d / safe, a / safe
        covariance[:, 0, 1] = covariance[:, 1, 0] = -b / safe
    return covariance


def _dilution(dx: Array, dy: Array, predicted: Array, used: NDArray[np.bool_]) -> Array:
    inverse = np.where(used, 1.0 / np.maximum(predicted, _NEAREST_M), 0.0)
    jx, jy = dx * inverse, dy * inverse
    a, b, d = np.sum(jx * jx, axis=1), np.sum(jx * jy, axis=1), np.sum(jy * jy, axis=1)
    determinant = a * d - b * b
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.asarray(
            np.where(
                np.isnan(determinant),
                np.nan,
                np.where(determinant > 0, np.sqrt((a + d) / determinant), np.inf),
            )
        )
