"""Weighted nonlinear least squares: the default solver.

With anchors a_j, tag height z and ranges r_j the cost is the sum of ((|p - a_j| - r_j) / sd_j)^2
over the plane position p, the distance being in three dimensions. Newton's method with
Levenberg-Marquardt damping from a linear start, over whole arrays of epochs; the covariance is
(J'WJ)^-1. Where the anchors of an epoch stand nearly in one line, the mirror image of the position
is a second minimum: both are sought, and the chance of having picked the wrong one enters the
covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.errors import GeometryError
from tablerunner.uwb.epochs import Array, Epochs, flatness
from tablerunner.uwb.fix import FixState, PositionFix, join_fixes
from tablerunner.uwb.solvers.judge import inverse_normal, judge
from tablerunner.uwb.solvers.linear import LEAST_FLATNESS, MINIMUM_RANGES, linear_place
from tablerunner.uwb.solvers.minimiser import Problem, minimise, normal_matrix
from tablerunner.uwb.solvers.sides import weigh_sides
from tablerunner.uwb.solvers.single import solve_single

TWO_SIDED = 0.5
"""Flatness under which both sides of the anchors' line are searched."""

_CHUNK = 8192  # epochs whose arrays stay in the processor's cache


def solve_positions(
    anchors: ArrayLike, ranges: ArrayLike, std: ArrayLike, tag_height: float
) -> PositionFix:
    """Return the least-squares positions of m epochs of ranges to n anchors.

    Parameters
    ----------
    anchors : array_like, shape (n, 3)
        Anchors in map [m].
    ranges : array_like, shape (m, n), or (n,) for one epoch
        Ranges [m]; NaN where one is missing.
    std : array_like, broadcast to (m, n)
        Standard deviation of each range [m].
    tag_height : float
        Height of the tag over the floor [m].

    Raises
    ------
    GeometryError
        Fewer than three anchors, or all of them in one line: no epoch can be solved.
    """
    return solve_nonlinear(Epochs.of(anchors, ranges, std, tag_height))


def solve_nonlinear(epochs: Epochs) -> PositionFix:
    """Return the positions of least weighted squares; see `solve_positions`."""
    check_layout(epochs.anchors)
    if len(epochs) == 1:
        fix = solve_single(epochs, TWO_SIDED)
        return _solve_chunk(epochs) if fix is None else fix
    if len(epochs) <= _CHUNK:
        return _solve_chunk(epochs)
    return join_fixes(
        [
            _solve_chunk(epochs.some(slice(first, first + _CHUNK)))
            for first in range(0, len(epochs), _CHUNK)
        ]
    )


def check_layout(anchors: Array) -> None:
    """Refuse anchors from which no position can be had.

    Raises
    ------
    GeometryError
        Fewer than three, or all of them in one line.
    """
    if len(anchors) < MINIMUM_RANGES:
        raise GeometryError(f'{len(anchors)} anchors are too few for a position, 3 are needed')
    # In plain floats: this runs for every single epoch.
    count = len(anchors)
    points = anchors[:, :2].tolist()
    mean_x = sum(point[0] for point in points) / count
    mean_y = sum(point[1] for point in points) / count
    a = sum((x - mean_x) ** 2 for x, _ in points)
    d = sum((y - mean_y) ** 2 for _, y in points)
    b = sum((x - mean_x) * (y - mean_y) for x, y in points)
    if a + d < count * 1e-6 or a * d - b * b < (LEAST_FLATNESS * (a + d)) ** 2:
        raise GeometryError('the anchors stand in one line: the side of the tag stays open')


def _solve_chunk(epochs: Epochs) -> PositionFix:
    used = epochs.usable
    ratio, centre, direction = flatness(epochs.anchors, used)
    state = np.full(len(epochs), FixState.SOLVED, dtype=np.int8)
    state[ratio < LEAST_FLATNESS] = FixState.IN_LINE
    state[used.sum(axis=1) < MINIMUM_RANGES] = FixState.TOO_FEW
    origin = epochs.anchors[:, :2].mean(axis=0)
    problem = Problem.of(epochs, origin)
    x, y, _, _ = linear_place(
        problem.x, problem.y, problem.range**2 - problem.height2, problem.weight
    )
    two_sided = (ratio < TWO_SIDED) & (state == FixState.SOLVED)
    start = np.stack([x, y])
    start[:, state != FixState.SOLVED] = 0.0
    other = np.empty((2, 0))
    if two_sided.any():
        first, other = _both_sides(
            problem.some(two_sided), (centre - origin)[two_sided], direction[two_sided]
        )
        start[:, two_sided] = first
    place, cost, found = minimise(problem, start)
    a, b, d = normal_matrix(problem, place)
    covariance = inverse_normal(a, b, d)
    if two_sided.any():
        spare = np.maximum(used[two_sided].sum(axis=1) - 2, 1)
        mirror, mirror_cost, mirror_found = minimise(problem.some(two_sided), other)
        chosen = weigh_sides(
            np.stack([place[:, two_sided], mirror]),
            np.stack(
                [
                    np.where(found[two_sided], cost[two_sided], np.inf),
                    np.where(mirror_found, mirror_cost, np.inf),
                ]
            ),
            spare,
        )
        place[:, two_sided] = chosen.place
        found[two_sided] |= mirror_found
        a, b, d = normal_matrix(problem.some(two_sided), chosen.place)
        inner = inverse_normal(a, b, d)
        covariance[two_sided] = inner + chosen.spread
        rows = np.flatnonzero(two_sided)
        state[rows[chosen.open(inner)]] = FixState.AMBIGUOUS
    state[(state == FixState.SOLVED) & ~found] = FixState.NOT_CONVERGED
    return judge(epochs, place.T + origin, covariance, used, state)


def _both_sides(problem: Problem, centre: Array, direction: Array) -> tuple[Array, Array]:
    # As though the anchors stood exactly in a line: the place along it follows from differences
    # of squares, the distance from it from what is left of the squares.
    ux, uy = direction.T
    along = (problem.x - centre[:, 0]) * ux + (problem.y - centre[:, 1]) * uy
    weight = problem.weight / problem.weight.sum(axis=0)
    along_mean = np.sum(weight * along, axis=0)
    along = along - along_mean
    square = np.maximum(problem.range**2 - problem.height2, 0.0)
    right = along**2 - square
    right = right - np.sum(weight * right, axis=0)
    u = np.sum(weight * along * right, axis=0) / (2.0 * np.sum(weight * along**2, axis=0))
    across2 = np.sum(weight * (square - (u - along) ** 2), axis=0)
    # Never on the line itself: the cost is level across it there.
    least = 0.05 * np.sqrt(np.sum(weight * along**2, axis=0))
    v = np.sqrt(np.maximum(across2, least**2))
    u = u + along_mean
    base_x, base_y = centre[:, 0] + u * ux, centre[:, 1] + u * uy
    return (
        np.stack([base_x - v * uy, base_y + v * ux]),
        np.stack([base_x + v * uy, base_y - v * ux]),
    )
