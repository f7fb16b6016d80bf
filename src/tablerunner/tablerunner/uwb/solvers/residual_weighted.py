"""Residual-weighted least squares: all subsets of ranges vote, by how well they agree.

The baseline RWLS of Bae 2022: every subset of three ranges or more is solved by linear least
squares; the positions are averaged with the inverse of their mean squared residual.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import GeometryError
from tablerunner.uwb.epochs import Array, Epochs, flatness
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.admit import at_least_the_bound
from tablerunner.uwb.solvers.judge import judge
from tablerunner.uwb.solvers.linear import LEAST_FLATNESS, MINIMUM_RANGES, linear_place
from tablerunner.uwb.solvers.sigma_points import propagate

MOST_ANCHORS = 10
"""Anchors for which every subset (968 of them) is still worth solving."""

_LEAST_SQUARE_M2 = 1e-12  # exact ranges leave no residual: a micrometre stands for none


def solve_residual_weighted(epochs: Epochs) -> PositionFix:
    """Return the mean of all subsets' positions, weighted by the inverse of their residuals.

    Raises
    ------
    GeometryError
        More than `MOST_ANCHORS` anchors.
    """
    if len(epochs.anchors) > MOST_ANCHORS:
        raise GeometryError(
            f'residual_weighted solves every subset: {MOST_ANCHORS} anchors at most, '
            f'there are {len(epochs.anchors)}'
        )
    usable = np.isfinite(epochs.plane_ranges())
    subsets = _subsets(epochs.anchors)
    ranges = np.where(usable, epochs.ranges, np.nan)
    place, used = _vote(epochs, ranges, subsets)
    covariance = propagate(
        lambda moved: _vote(epochs, moved, subsets)[0], ranges, epochs.std, used
    )
    covariance = at_least_the_bound(epochs, place, covariance, used)
    state = np.where(used.any(axis=1), FixState.SOLVED, FixState.IN_LINE).astype(np.int8)
    state[usable.sum(axis=1) < MINIMUM_RANGES] = FixState.TOO_FEW
    return judge(epochs, place, covariance, used, state)


def _subsets(anchors: Array) -> tuple[tuple[int, ...], ...]:
    found = []
    for size in range(MINIMUM_RANGES, len(anchors) + 1):
        for subset in combinations(range(len(anchors)), size):
            mask = np.zeros((1, len(anchors)), dtype=bool)
            mask[0, list(subset)] = True
            if flatness(anchors, mask)[0][0] >= LEAST_FLATNESS:
                found.append(subset)
    return tuple(found)


def _vote(
    epochs: Epochs, ranges: Array, subsets: tuple[tuple[int, ...], ...]
) -> tuple[Array, NDArray[np.bool_]]:
    origin = epochs.anchors[:, :2].mean(axis=0)
    x, y = (epochs.anchors[:, :2] - origin).T[:, :, None]
    height2 = epochs.height[:, None] ** 2
    slant = np.maximum(ranges.T, 0.0)
    square = np.maximum(slant**2 - height2, 0.0)
    sum_x, sum_y, total = (np.zeros(len(ranges)) for _ in range(3))
    used = np.zeros(ranges.shape, dtype=bool)
    for subset in subsets:
        few = list(subset)
        px, py, _, _ = linear_place(x[few], y[few], square[few], np.ones((len(few), 1)))
        predicted = np.sqrt((px - x[few]) ** 2 + (py - y[few]) ** 2 + height2[few])
        misfit = np.mean((predicted - slant[few]) ** 2, axis=0)
        weight = 1.0 / np.maximum(misfit, _LEAST_SQUARE_M2)
        sound = np.isfinite(weight)
        weight = np.where(sound, weight, 0.0)
        sum_x += weight * np.where(sound, px, 0.0)
        sum_y += weight * np.where(sound, py, 0.0)
        total += weight
        used[:, few] |= sound[:, None]
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = np.stack([sum_x, sum_y], axis=1) / np.where(total > 0, total, np.nan)[:, None]
    return mean + origin, used
