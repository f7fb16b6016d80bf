"""Damped Newton steps on the weighted squares of range residuals, many epochs at once.

Arrays run over anchors first, so that every sum over anchors adds long rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs

NEAREST_M = 1e-9
"""Closer to an anchor than this, its direction is not divided by the distance."""

ITERATIONS = 60
CONVERGED_M = 1e-9
"""A step shorter than this ends the search."""

CURVED = 1e-9
"""Determinant of the second derivatives over their squared trace that counts as convex."""

NO_PROGRESS = 1e-13
"""Share of the cost by which rounding may raise it."""


@dataclass(frozen=True)
class Problem:
    """What the cost of m epochs depends on.

    Attributes
    ----------
    x, y : ndarray, shape (n, 1)
        Anchors about `origin` [m].
    height2 : ndarray, shape (n, 1)
        Squared height of each anchor over the tag [m^2].
    range, weight : ndarray, shape (n, m)
        Range [m] and 1/variance [1/m^2]; weight 0 where there is none.
    """

    x: Array
    y: Array
    height2: Array
    range: Array
    weight: Array

    @classmethod
    def of(cls, epochs: Epochs, origin: Array) -> Problem:
        """Return the problem of these epochs in coordinates about `origin`."""
        used = epochs.usable
        x, y = (epochs.anchors[:, :2] - origin).T[:, :, None]
        return cls(
            x,
            y,
            epochs.height[:, None] ** 2,
            np.ascontiguousarray(np.where(used, epochs.ranges, 1.0).T),
            np.ascontiguousarray(np.where(used, 1.0 / epochs.std**2, 0.0).T),
        )

    def some(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> Problem:
        """Return only these epochs."""
        return Problem(self.x, self.y, self.height2, self.range[:, rows], self.weight[:, rows])


def minimise(problem: Problem, start: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the minimum that lies downhill of each start.

    Parameters
    ----------
    start : ndarray, shape (2, m)

    Returns
    -------
    place : ndarray, shape (2, m)
    cost : ndarray, shape (m,)
        Chi-square there.
    found : ndarray of bool, shape (m,)
        Whether the search ended.
    """
    count = start.shape[1]
    place, found = start.copy(), np.zeros(count, dtype=bool)
    final = np.empty(count)
    active = np.arange(count)
    here = start.copy()
    damping = np.full(count, 1e-9)
    cost, gradient, newton, normal = _expand(problem, here)
    for _ in range(ITERATIONS):
        step = _step(gradient, newton, normal, damping)
        trial = here - step
        new_cost, new_gradient, new_newton, new_normal = _expand(problem, trial)
        better = new_cost <= cost * (1.0 + NO_PROGRESS)
        here = np.where(better, trial, here)
        cost = np.where(better, new_cost, cost)
        done = np.hypot(step[0], step[1]) < CONVERGED_M
        if done.any():
            place[:, active[done]], final[active[done]] = here[:, done], cost[done]
            found[active[done]] = True
            going = ~done
            active, here, cost = active[going], here[:, going], cost[going]
            if not len(active):
                break
            problem, better, damping = problem.some(going), better[going], damping[going]
            gradient, new_gradient = gradient[:, going], new_gradient[:, going]
            newton, new_newton = newton[:, going], new_newton[:, going]
            normal, new_normal = normal[:, going], new_normal[:, going]
        gradient = np.where(better, new_gradient, gradient)
        newton = np.where(better, new_newton, newton)
        normal = np.where(better, new_normal, normal)
        damping = np.where(better, np.maximum(damping * 0.01, 1e-9), damping * 10.0 + 1e-4)
    if len(active):
        place[:, active], final[active] = here, cost
    return place, final, found


def normal_matrix(problem: Problem, place: Array) -> tuple[Array, Array, Array]:
    """Return xx, xy and yy of J'WJ at the places, each of shape (m,)."""
    _, _, _, (a, b, d) = _expand(problem, place)
    return a, b, d


def _expand(problem: Problem, place: Array) -> tuple[Array, Array, Array, Array]:
    """Return cost (m,), gradient (2, m), second derivatives (3, m) and J'WJ (3, m)."""
    dx, dy = place[0] - problem.x, place[1] - problem.y
    predicted = np.sqrt(dx * dx + dy * dy + problem.height2)
    inverse = 1.0 / np.maximum(predicted, NEAREST_M)
    jx, jy = dx * inverse, dy * inverse
    residual = predicted - problem.range
    weighted = problem.weight * residual
    cost = np.sum(weighted * residual, axis=0)
    gradient = np.stack([np.sum(weighted * jx, axis=0), np.sum(weighted * jy, axis=0)])
    normal = np.empty((3, place.shape[1]))
    wx = problem.weight * jx
    np.sum(wx * jx, axis=0, out=normal[0])
    np.sum(wx * jy, axis=0, out=normal[1])
    np.sum(problem.weight * jy * jy, axis=0, out=normal[2])
    # The range's own curvature, (I - jj') residual / distance, makes the last steps quadratic.
    bend = weighted * inverse
    newton = np.empty_like(normal)
    total = np.sum(bend, axis=0)
    bend_x = bend * jx
    newton[0] = normal[0] + total - np.sum(bend_x * jx, axis=0)
    newton[1] = normal[1] - np.sum(bend_x * jy, axis=0)
    newton[2] = normal[2] + total - np.sum(bend * jy * jy, axis=0)
    return cost, gradient, newton, normal


def _step(gradient: Array, newton: Array, normal: Array, damping: Array) -> Array:
    trace = newton[0] + newton[2]
    convex = (newton[0] * newton[2] - newton[1] ** 2 > CURVED * trace**2) & (trace > 0)
    # Where the cost is not convex, Gauss and Newton's matrix is, and leads downhill.
    matrix = np.where(convex, newton, normal)
    added = np.where(convex, damping, np.maximum(damping, 1e-3)) * (normal[0] + normal[2])
    a, b, d = matrix[0] + added, matrix[1], matrix[2] + added
    determinant = a * d - b * b
    safe = np.where(determinant > 0.0, determinant, np.inf)
    return np.stack(
        [(d * gradient[0] - b * gradient[1]) / safe, (a * gradient[1] - b * gradient[0]) / safe]
    )
