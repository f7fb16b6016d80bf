"""Linear least squares on squared ranges (Liu 2-5, Bae 2-5).

In the tag's plane each range says -2 a_j' p + r = d_j^2 - |a_j|^2, with r = |p|^2 for a third
unknown. Solved for p alone, that is the same as subtracting the mean equation from each: 2 (a_j -
mean a)' p = (|a_j|^2 - d_j^2) - its mean.
"""

from __future__ import annotations

import numpy as np

from tablerunner.uwb.epochs import Array, Epochs, flatness
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.judge import judge

MINIMUM_RANGES = 3
LEAST_FLATNESS = 1e-3
"""Spread across over spread along, under which anchors stand in one line."""


def solve_linear(epochs: Epochs) -> PositionFix:
    """Return the least-squares positions of the linearised circles, every range counting alike.

    Parameters
    ----------
    epochs : Epochs
        At least three ranges an epoch; heights may differ.
    """
    plane = epochs.plane_ranges()
    used = np.isfinite(plane)
    weight = used.T.astype(np.float64)
    origin = epochs.anchors[:, :2].mean(axis=0) if len(epochs.anchors) else np.zeros(2)
    x, y = (epochs.anchors[:, :2] - origin).T[:, :, None]
    square = np.where(used, plane, 0.0).T ** 2
    px, py, left_x, left_y = linear_place(x, y, square, weight)
    state = np.full(len(epochs), FixState.SOLVED, dtype=np.int8)
    state[flatness(epochs.anchors, used)[0] < LEAST_FLATNESS] = FixState.IN_LINE
    state[used.sum(axis=1) < MINIMUM_RANGES] = FixState.TOO_FEW
    # p = L (squares), so that a range's error counts -2 r L; a height changes nothing in that.
    error = np.where(used, -2.0 * epochs.ranges * epochs.std, 0.0).T
    gain_x, gain_y = left_x * error, left_y * error
    covariance = np.empty((len(epochs), 2, 2))
    covariance[:, 0, 0] = np.sum(gain_x**2, axis=0)
    covariance[:, 1, 1] = np.sum(gain_y**2, axis=0)
    covariance[:, 0, 1] = covariance[:, 1, 0] = np.sum(gain_x * gain_y, axis=0)
    return judge(epochs, np.stack([px, py], axis=1) + origin, covariance, used, state)


def linear_place(
    x: Array, y: Array, square: Array, weight: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the weighted linear solution of m epochs, anchors first.

    Parameters
    ----------
    x, y : ndarray, shape (n, 1)
        Anchors [m], best about their mean.
    square : ndarray, shape (n, m)
        Squares of the ranges in the tag's plane [m^2]; anything finite where the weight is 0.
    weight : ndarray, shape (n, m)

    Returns
    -------
    x, y : ndarray, shape (m,)
        Position [m]; 0 where the anchors stand in one line.
    left_x, left_y : ndarray, shape (n, m)
        d(x), d(y) over d(|a_j|^2 - square_j) [1/m].
    """
    total = np.maximum(weight.sum(axis=0), 1e-300)
    centred_x = 2.0 * (x - np.sum(weight * x, axis=0) / total)
    centred_y = 2.0 * (y - np.sum(weight * y, axis=0) / total)
    wx, wy = weight * centred_x, weight * centred_y
    a, d = np.sum(wx * centred_x, axis=0), np.sum(wy * centred_y, axis=0)
    b = np.sum(wx * centred_y, axis=0)
    determinant = a * d - b * b
    safe = np.where(determinant > 1e-14 * (a + d) ** 2, determinant, np.inf)
    left_x = (d * wx - b * wy) / safe
    left_y = (a * wy - b * wx) / safe
    right = x * x + y * y - square
    return np.sum(left_x * right, axis=0), np.sum(left_y * right, axis=0), left_x, left_y
