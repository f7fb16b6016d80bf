"""Modified hyperbolic: two circles give two points, the other ranges choose (Bae's M-HB).

Every pair of ranges proposes the one of its two intersections with which the remaining ranges
agree better; the proposal with the best agreement of all pairs is the position.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs, flatness
from tablerunner.uwb.fix import PLANE_UNKNOWNS, FixState, PositionFix
from tablerunner.uwb.solvers.circle_pair import blur, meet, plane_of
from tablerunner.uwb.solvers.judge import judge
from tablerunner.uwb.solvers.linear import LEAST_FLATNESS, MINIMUM_RANGES
from tablerunner.uwb.solvers.sides import weigh_sides
from tablerunner.uwb.solvers.sigma_points import propagate


def solve_hyperbolic(epochs: Epochs) -> PositionFix:
    """Return the intersection of two circles with which the other ranges agree best.

    Its covariance is that of the two ranges that make it, and grows with the doubt about the side.
    """
    usable = np.isfinite(epochs.plane_ranges())
    count = usable.sum(axis=1)
    ranges = np.where(usable, epochs.ranges, np.nan)
    pairs, points, costs = _choose(epochs, ranges)
    left = costs[0] <= costs[1]
    made = np.zeros(usable.shape, dtype=bool)
    np.put_along_axis(made, pairs, True, axis=1)

    def chosen(moved: Array) -> Array:
        first, second = meet(epochs, moved, pairs, chord=True)
        return np.where(left[:, None], first, second)

    covariance = propagate(chosen, ranges, epochs.std, made & usable)
    covariance += blur(epochs, epochs.ranges, pairs)
    sides = weigh_sides(points, costs, np.maximum(count - PLANE_UNKNOWNS, 1))
    state = np.full(len(epochs), FixState.SOLVED, dtype=np.int8)
    state[sides.open(covariance)] = FixState.AMBIGUOUS
    state[~np.isfinite(sides.place).all(axis=0)] = FixState.NO_MEETING
    state[flatness(epochs.anchors, usable)[0] < LEAST_FLATNESS] = FixState.IN_LINE
    state[count < MINIMUM_RANGES] = FixState.TOO_FEW
    # All ranges had a say: the residual test is over all.
    return judge(epochs, sides.place.T, covariance + sides.spread, usable, state)


def _choose(epochs: Epochs, ranges: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Return per epoch the pair, shape (m, 2), its points, (2, 2, m), and their costs, (2, m)."""
    count = len(ranges)
    plane = plane_of(ranges, epochs.height)
    pairs = np.zeros((count, 2), dtype=np.int64)
    points, costs = np.full((2, 2, count), np.nan), np.full((2, count), np.inf)
    for pair in combinations(range(ranges.shape[1]), 2):
        rest = [j for j in range(ranges.shape[1]) if j not in pair]
        both = meet(epochs, ranges, np.tile(pair, (count, 1)), chord=True)
        # Every pair leaves as many ranges over: their sums compare.
        trial = np.stack([_misfit(epochs, plane, point, rest) for point in both])
        better = trial.min(axis=0) < costs.min(axis=0)
        pairs[better] = pair
        costs = np.where(better, trial, costs)
        points = np.where(better, np.stack([both[0].T, both[1].T]), points)
    return pairs, points, costs


def _misfit(epochs: Epochs, plane: Array, point: Array, rest: list[int]) -> Array:
    """Return how the other ranges disagree with the points, in the manner of a chi-square, (m,).

    The square of the sum of the residuals' sizes over their number: never above their chi-square,
    and a long residual counts no more than several short ones.
    """
    offset = point[:, None, :] - epochs.anchors[None, rest, :2]
    residual = np.hypot(offset[..., 0], offset[..., 1]) - plane[:, rest]
    size = np.abs(residual) / epochs.std[:, rest]
    there = np.isfinite(size)
    count = there.sum(axis=1)
    total = np.where(there, size, 0.0).sum(axis=1)
    # NaN, which is never better, where circles do not meet or no range is left to choose.
    return np.asarray(np.where(count > 0, total**2 / np.maximum(count, 1), np.nan))
