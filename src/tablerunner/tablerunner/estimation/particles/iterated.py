"""EKF, IEKF and Levenberg-Marquardt IEKF updates of many Gaussians at once.

Prior N(m, P), measurement z = h(x) + v, v ~ N(0, R). All three seek the maximum a posteriori, the
least of the cost

    V(x) = (x - m)' P^-1 (x - m) + (z - h(x))' R^-1 (z - h(x))

The EKF takes one Gauss-Newton step from m, the IEKF as many as it takes (Bell and Cathey 1993):

    x_{i+1} = m + K_i (z - h(x_i) - H_i (m - x_i)),  K_i = P H_i' (H_i P H_i' + R)^-1

Undamped steps may run away where h bends much. Levenberg-Marquardt (Skoglund, Hendeby and Axehill
2015; the paper's UIEKF) makes the prior tighter about x_i:

    P~_i    = [I - P (P + I/mu_i)^-1] P = (P^-1 + mu_i I)^-1
    x_{i+1} = m + K_i (z - h(x_i) - H_i (m - x_i)) - mu_i (I - K_i H_i) P~_i (m - x_i)

with K_i of P~_i. That is the step d of (P^-1 + mu I + H' R^-1 H) d = P^-1 (m - x) + H' R^-1 (z -
h(x)), as the test shows. It begins undamped: mu = 0. A step that does not lower V is not taken, mu
grows tenfold (from a thousandth of the mean curvature on); after one that does, it shrinks
tenfold.

The state is sought as x = m + L y with P = L L'. So the prior of y is standard normal, and a P
that is singular (a state that is known) needs no inverse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Matrix, Vector

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

Look = Callable[[Matrix, Rows], tuple[Matrix, Array]]
"""Takes states, shape (k, n), and which of all they are, (k,); returns z - h(x), (k, m), and H,
(k, m, n)."""


@dataclass(frozen=True, slots=True)
class Iteration:
    """How far an update iterates.

    Attributes
    ----------
    steps : int
        At most; one without damping is the EKF.
    damped : bool
        Levenberg-Marquardt.
    tolerance : float
        A step shorter than this, in deviations of the posterior, is the last.
    """

    steps: int = 1
    damped: bool = False
    tolerance: float = 1e-3


EKF = Iteration()
IEKF = Iteration(30)
UIEKF = Iteration(30, damped=True)


class Updated(NamedTuple):
    """What the updates came to, for n Gaussians of d states.

    Attributes
    ----------
    mean : ndarray, shape (n, d)
    whitened : ndarray, shape (n, d)
        The same as y of m + L y.
    factor : ndarray, shape (n, d, d)
        Lower triangular C: C C' is the inverse covariance of y.
    cost : ndarray, shape (n,)
        V at the mean.
    first_cost : ndarray, shape (n,)
        V at m.
    converged : ndarray of bool, shape (n,)
        Whether the last step was short enough; an EKF never knows.
    steps : ndarray of int, shape (n,)
        Steps that were tried.
    """

    mean: Matrix
    whitened: Matrix
    factor: Array
    cost: Vector
    first_cost: Vector
    converged: NDArray[np.bool_]
    steps: NDArray[np.intp]


def update(mean: Matrix, root: Array, look: Look, noise: Matrix, iteration: Iteration) -> Updated:
    """Return the Gaussian that an EKF, IEKF or LM-IEKF makes of each prior.

    Parameters
    ----------
    mean : ndarray, shape (n, d)
    root : ndarray, shape (n, d, d)
        L of the prior covariance L L'.
    look : callable
        The measurement, seen from states.
    noise : ndarray, shape (m, m)
        R, the same for all.
    iteration : Iteration
    """
    count, size = mean.shape
    whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
    everyone = np.arange(count)
    offset, slope = _whitened(look, mean, everyone, root, whiten)
    state = _State(np.zeros((count, size)), offset, slope, np.sum(offset**2, axis=1))
    first_cost = state.cost.copy()
    metric = np.swapaxes(root, -1, -2) @ root if iteration.damped else None
    damping, steps = np.zeros(count), np.zeros(count, dtype=np.intp)
    converged = np.zeros(count, dtype=bool)
    active = everyone
    for _ in range(iteration.steps):
        curvature = _curvature(state.slope[active])
        pull = np.einsum('kmd,km->kd', state.slope[active], state.offset[active])
        pull -= state.y[active]
        bent = curvature
        if metric is not None and damping[active].any():
            bent = curvature + damping[active, None, None] * metric[active]
        step = np.linalg.solve(bent, pull[..., None])[..., 0]
        tried = state.y[active] + step
        place = mean[active] + np.einsum('kij,kj->ki', root[active], tried)
        offset, slope = _whitened(look, place, active, root[active], whiten)
        cost = np.sum(tried**2, axis=1) + np.sum(offset**2, axis=1)
        if iteration.steps == 1:
            slope = state.slope  # an EKF linearises at the prior, its covariance too
        steps[active] += 1
        short = np.einsum('ki,ki->k', step, pull) < iteration.tolerance**2
        better = np.ones(len(active), dtype=bool)
        if metric is not None:
            better = cost <= state.cost[active]
            damping[active] = _damping(damping[active], better, curvature, metric[active])
        state.take(active, better, tried, offset, slope, cost)
        # A short step that is no better has met the rounding of V: there is nothing below.
        converged[active] = short
        active = active[~short]
        if not len(active):
            break
    factor: Array = np.asarray(np.linalg.cholesky(_curvature(state.slope)), dtype=float)
    found = mean + np.einsum('kij,kj->ki', root, state.y)
    return Updated(found, state.y, factor, state.cost, first_cost, converged, steps)


def drawn(mean: Matrix, root: Array, updated: Updated, noise: Matrix) -> tuple[Matrix, Vector]:
    """Return draws from the updated Gaussians, and log prior less log proposal of each.

    Parameters
    ----------
    mean, root
        The priors, as for `update`.
    updated : Updated
    noise : ndarray, shape (n, d)
        Standard normal.
    """
    # y = y* + C'^-1 e; the normalising constants and |L| are in both densities.
    inverse = np.linalg.inv(updated.factor)
    y = updated.whitened + np.einsum('kji,kj->ki', inverse, noise)
    volume = np.sum(np.log(np.diagonal(updated.factor, axis1=1, axis2=2)), axis=1)
    ratio = 0.5 * np.sum(noise**2, axis=1) - 0.5 * np.sum(y**2, axis=1) - volume
    return mean + np.einsum('kij,kj->ki', root, y), ratio


def covariance_of(root: Array, updated: Updated) -> Array:
    """Return the posterior covariances, shape (n, d, d)."""
    inverse = np.linalg.inv(updated.factor)
    half = root @ np.swapaxes(inverse, -1, -2)
    return np.asarray(half @ np.swapaxes(half, -1, -2))


class _State:
    """Where the search is: y, whitened z - h and H L there, and V."""

    def __init__(self, y: Matrix, offset: Matrix, slope: Array, cost: Vector) -> None:
        self.y, self.offset, self.slope, self.cost = y, offset, slope, cost

    def take(
        self,
        rows: Rows,
        better: NDArray[np.bool_],
        y: Matrix,
        offset: Matrix,
        slope: Array,
        cost: Vector,
    ) -> None:
        """Go to another place, where it is better."""
        into = rows[better]
        self.y[into], self.offset[into] = y[better], offset[better]
        self.slope[into], self.cost[into] = slope[better], cost[better]


def _whitened(
    look: Look, place: Matrix, rows: Rows, root: Array, whiten: Matrix
) -> tuple[Matrix, Array]:
    """Return R^-1/2 (z - h) and R^-1/2 H L."""
    offset, slope = look(place, rows)
    return offset @ whiten, np.swapaxes(whiten, 0, 1) @ (slope @ root)


def _curvature(slope: Array) -> Array:
    """Return I + (H L)' R^-1 (H L)."""
    return np.asarray(np.eye(slope.shape[-1]) + np.swapaxes(slope, -1, -2) @ slope)


def _damping(
    damping: Vector, better: NDArray[np.bool_], curvature: Array, metric: Array
) -> Vector:
    least = 1e-3 * _trace(curvature) / np.maximum(_trace(metric), 1e-300)
    less = np.where(0.1 * damping < least, 0.0, 0.1 * damping)
    return np.where(better, less, np.maximum(10.0 * damping, least))


def _trace(matrices: Array) -> Vector:
    return np.asarray(np.trace(matrices, axis1=1, axis2=2))
