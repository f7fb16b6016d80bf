"""Position from ranges by nonlinear least squares, over whole arrays of epochs at once.

With anchors a_j, tag height z and ranges r_j the cost is the sum of ((|p - a_j| - r_j) / sd_j)^2
over the plane position p. Levenberg-Marquardt from a linear start (differences of squared ranges,
Liu 2-5, with the slant range carried down to the tag's plane). Covariance is the inverse of J'WJ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import GeometryError

Array = NDArray[np.float64]

MINIMUM_RANGES = 3
_ITERATIONS = 12
_MIN_CONDITION = 1e-6  # of the normal matrix, relative: below it the anchors stand in a line


@dataclass(frozen=True)
class PositionFix:
    """Positions of m epochs.

    Attributes
    ----------
    position : ndarray, shape (m, 2)
        Tag in map [m]; NaN where the epoch has no answer.
    covariance : ndarray, shape (m, 2, 2)
    residual_rms : ndarray, shape (m,)
        Root mean square of range residuals [m].
    used : ndarray of int, shape (m,)
        Ranges used.
    """

    position: Array
    covariance: Array
    residual_rms: Array
    used: NDArray[np.int64]


def solve_positions(
    anchors: Array, ranges: Array, std: Array | float, tag_height: float
) -> PositionFix:
    """Return the least-squares positions of m epochs of ranges to n anchors.

    Parameters
    ----------
    anchors : ndarray, shape (n, 3)
        Anchors in map [m].
    ranges : ndarray, shape (m, n)
        Ranges [m]; NaN where one is missing.
    std : float or ndarray, broadcast to (m, n)
        Standard deviation of each range [m].
    tag_height : float
        Height of the tag over the floor [m].

    Raises
    ------
    GeometryError
        Fewer than three anchors, or all of them in one line: no epoch can be solved.
    """
    if len(anchors) < MINIMUM_RANGES:
        raise GeometryError(f'{len(anchors)} anchors are too few for a position, 3 are needed')
    spread = anchors[:, :2] - anchors[:, :2].mean(axis=0)
    if np.linalg.svd(spread, compute_uv=False)[1] < 1e-3 * max(1.0, float(np.abs(spread).max())):
        raise GeometryError('the anchors stand in one line: the side of the tag stays open')
    valid = np.isfinite(ranges) & (ranges > 0)
    weight = np.where(valid, 1.0 / np.broadcast_to(std, ranges.shape) ** 2, 0.0)
    distance = np.where(valid, ranges, 1.0)
    height = anchors[:, 2] - tag_height
    position = _linear_start(anchors, distance, height, valid)
    damping = np.full(len(ranges), 1e-3)
    cost, gradient, normal = _expand(position, anchors, distance, height, weight)
    for _ in range(_ITERATIONS):
        diagonal = damping[:, None] * np.maximum(normal[:, [0, 1], [0, 1]], 1e-12)
        damped = normal.copy()
        damped[:, [0, 1], [0, 1]] += diagonal
        step = _solve2(damped, gradient)
        trial = position - step
        new_cost, new_gradient, new_normal = _expand(trial, anchors, distance, height, weight)
        better = new_cost <= cost
        position = np.where(better[:, None], trial, position)
        cost = np.where(better, new_cost, cost)
        gradient = np.where(better[:, None], new_gradient, gradient)
        normal = np.where(better[:, None, None], new_normal, normal)
        damping = np.where(better, damping * 0.1, damping * 10.0)
        if np.all(np.abs(step) < 1e-9):
            break
    return _judge(position, anchors, distance, height, valid, normal)


def gdop(anchors: Array, position: Array, tag_height: float) -> Array:
    """Return the geometric dilution of precision of a plane fix.

    Parameters
    ----------
    anchors : ndarray, shape (n, 3)
    position : ndarray, shape (m, 2)

    Returns
    -------
    ndarray, shape (m,)
        Position error [m] per metre of range error; inf where nothing is determined.
    """
    weight = np.ones((len(position), len(anchors)))
    height = anchors[:, 2] - tag_height
    _, _, normal = _expand(position, anchors, weight, height, weight)
    determinant = normal[:, 0, 0] * normal[:, 1, 1] - normal[:, 0, 1] ** 2
    trace = normal[:, 0, 0] + normal[:, 1, 1]
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.asarray(np.where(determinant > 0, np.sqrt(trace / determinant), np.inf))


def _linear_start(anchors: Array, ranges: Array, height: Array, valid: NDArray[np.bool_]) -> Array:
    # Centred on the mean of the anchors that answered, each range gives
    # 2 (a_j - mean)' p = |a_j|^2 - d_j^2 - their mean, with d the distance in the tag's plane.
    plane2 = np.maximum(ranges**2 - height**2, 0.0)
    count = np.maximum(valid.sum(axis=1, keepdims=True), 1)
    squares = np.where(valid, np.sum(anchors[:, :2] ** 2, axis=1) - plane2, 0.0)
    right = np.where(valid, squares - squares.sum(axis=1, keepdims=True) / count, 0.0)
    x = np.where(valid, anchors[:, 0], 0.0)
    y = np.where(valid, anchors[:, 1], 0.0)
    left_x = 2 * np.where(valid, anchors[:, 0] - x.sum(axis=1, keepdims=True) / count, 0.0)
    left_y = 2 * np.where(valid, anchors[:, 1] - y.sum(axis=1, keepdims=True) / count, 0.0)
    normal = np.empty((len(ranges), 2, 2))
    normal[:, 0, 0] = np.sum(left_x**2, axis=1)
    normal[:, 1, 1] = np.sum(left_y**2, axis=1)
    normal[:, 0, 1] = normal[:, 1, 0] = np.sum(left_x * left_y, axis=1)
    vector = np.stack([np.sum(left_x * right, axis=1), np.sum(left_y * right, axis=1)], axis=1)
    return _solve2(normal, vector)


def _expand(
    position: Array, anchors: Array, ranges: Array, height: Array, weight: Array
) -> tuple[Array, Array, Array]:
    """Return cost (m,), gradient (m, 2) and normal matrix (m, 2, 2) at the positions."""
    dx = position[:, 0, None] - anchors[:, 0]
    dy = position[:, 1, None] - anchors[:, 1]
    predicted = np.sqrt(dx**2 + dy**2 + height**2)
    inverse = 1.0 / np.maximum(predicted, 1e-9)
    jx, jy = dx * inverse, dy * inverse
    residual = predicted - ranges
    weighted = weight * residual
    cost = np.sum(weighted * residual, axis=1)
    gradient = np.stack([np.sum(jx * weighted, axis=1), np.sum(jy * weighted, axis=1)], axis=1)
    normal = np.empty((len(position), 2, 2))
    normal[:, 0, 0] = np.sum(weight * jx**2, axis=1)
    normal[:, 1, 1] = np.sum(weight * jy**2, axis=1)
    normal[:, 0, 1] = normal[:, 1, 0] = np.sum(weight * jx * jy, axis=1)
    return cost, gradient, normal


def _solve2(matrix: Array, vector: Array) -> Array:
    """Return the solutions of m symmetric 2 x 2 systems; zero where one is singular."""
    a, b, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1]
    determinant = a * d - b * b
    safe = np.where(determinant > 1e-12 * np.maximum(a * d, 1e-12), determinant, np.inf)
    return np.stack(
        [
            (d * vector[:, 0] - b * vector[:, 1]) / safe,
            (a * vector[:, 1] - b * vector[:, 0]) / safe,
        ],
        axis=1,
    )


def _judge(
    position: Array,
    anchors: Array,
    ranges: Array,
    height: Array,
    valid: NDArray[np.bool_],
    normal: Array,
) -> PositionFix:
    used = valid.sum(axis=1)
    a, b, d = normal[:, 0, 0], normal[:, 0, 1], normal[:, 1, 1]
    determinant = a * d - b * b
    solved = (used >= MINIMUM_RANGES) & (determinant > _MIN_CONDITION * (a + d) ** 2)
    safe = np.where(solved, determinant, np.nan)
    covariance = np.empty_like(normal)
    covariance[:, 0, 0], covariance[:, 1, 1] = d / safe, a / safe
    covariance[:, 0, 1] = covariance[:, 1, 0] = -b / safe
    offset = position[:, None, :] - anchors[None, :, :2]
    predicted = np.sqrt(np.sum(offset**2, axis=-1) + height**2)
    squares = np.where(valid, (predicted - ranges) ** 2, 0.0)
    rms = np.sqrt(squares.sum(axis=1) / np.maximum(used, 1))
    return PositionFix(
        np.where(solved[:, None], position, np.nan),
        covariance,
        np.where(solved, rms, np.nan),
        used,
    )
