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

from tablerunner.estimation.particles.triangular import curvature, solved, spread, times
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
    spread : ndarray, shape (n, d, d)
        B: B B' is the covariance of y.
    log_size : ndarray, shape (n,)
        Log of the determinant of B.
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
    spread: Array
    log_size: Vector
    cost: Vector
    first_cost: Vector
    converged: NDArray[np.bool_]
    steps: NDArray[np.intp]


def update(
    mean: Matrix,
    root: Array,
    look: Look,
    noise: Matrix,
    iteration: Iteration,
    first: tuple[Matrix, Array] | None = None,
) -> Updated:
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
    first : tuple, optional
        What `look` says at the means, if that is known already.
    """
    count, size = mean.shape
    whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
    everyone = np.arange(count)
    offset, slope = _whitened(first or look(mean, everyone), root, whiten)
    state = _State(np.zeros((count, size)), offset, slope, np.sum(offset**2, axis=1))
    first_cost = state.cost.copy()
    metric = np.swapaxes(root, -1, -2) @ root if iteration.damped else None
    damping, steps = np.zeros(count), np.zeros(count, dtype=np.intp)
    converged = np.zeros(count, dtype=bool)
    active = everyone
    for _ in range(iteration.steps):
        here = state.slope[active]
        pull = times(np.swapaxes(here, 1, 2), state.offset[active]) - state.y[active]
        if metric is not None and damping[active].any():
            bent = curvature(here) + damping[active, None, None] * metric[active]
            step = np.linalg.solve(bent, pull[..., None])[..., 0]
        else:
            step = solved(here, pull)
        tried = state.y[active] + step
        place = mean[active] + times(root[active], tried)
        offset, slope = _whitened(look(place, active), root[active], whiten)
        cost = np.sum(tried**2, axis=1) + np.sum(offset**2, axis=1)
        if iteration.steps == 1:
            slope = state.slope  # an EKF linearises at the prior, its covariance too
        steps[active] += 1
        short = np.sum(step * pull, axis=1) < iteration.tolerance**2
        better = np.ones(len(active), dtype=bool)
        if metric is not None:
            better = cost <= state.cost[active]
            damping[active] = _damping(damping[active], better, here, metric[active])
        state.take(active, better, tried, offset, slope, cost)
        # A short step that is no better has met the rounding of V: there is nothing below.
        converged[active] = short
        active = active[~short]
        if not len(active):
            break
    half, log_size = spread(state.slope)
    found = mean + times(root, state.y)
    return Updated(found, state.y, half, log_size, state.cost, first_cost, converged, steps)


class Drawn(NamedTuple):
    """Draws from updated Gaussians.

    Attributes
    ----------
    states : ndarray, shape (n, d)
    whitened : ndarray, shape (n, d)
        The same as y of m + L y.
    log_ratio : ndarray, shape (n,)
        Log prior less log proposal.
    """

    states: Matrix
    whitened: Matrix
    log_ratio: Vector


def drawn(mean: Matrix, root: Array, updated: Updated, noise: Matrix) -> Drawn:
    """Return draws from the updated Gaussians, with their ratio of prior and proposal.

    Parameters
    ----------
    mean, root
        The priors, as for `update`.
    updated : Updated
    noise : ndarray, shape (n, d)
        Standard normal.
    """
    # y = y* + B e; the normalising constants and |L| are in both densities.
    y = updated.whitened + times(updated.spread, noise)
    ratio = 0.5 * np.sum(noise**2, axis=1) - 0.5 * np.sum(y**2, axis=1) + updated.log_size
    return Drawn(mean + times(root, y), y, ratio)


def covariance_of(root: Array, updated: Updated) -> Array:
    """Return the posterior covariances, shape (n, d, d)."""
    half = root @ updated.spread
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


def _whitened(seen: tuple[Matrix, Array], root: Array, whiten: Matrix) -> tuple[Matrix, Array]:
    """Return R^-1/2 (z - h) and R^-1/2 H L."""
    offset, slope = seen
    along = slope @ root
    count, rows, size = along.shape
    # One product of matrices for all, instead of one for each.
    flat = whiten.T @ along.transpose(1, 0, 2).reshape(rows, -1)
    return offset @ whiten, flat.reshape(rows, count, size).transpose(1, 0, 2)


def _damping(damping: Vector, better: NDArray[np.bool_], slope: Array, metric: Array) -> Vector:
    curved = slope.shape[-1] + np.sum(slope**2, axis=(1, 2))
    least = 1e-3 * curved / np.maximum(_trace(metric), 1e-300)
    less = np.where(0.1 * damping < least, 0.0, 0.1 * damping)
    return np.where(better, less, np.maximum(10.0 * damping, least))


def _trace(matrices: Array) -> Vector:
    return np.asarray(np.trace(matrices, axis1=1, axis2=2))
