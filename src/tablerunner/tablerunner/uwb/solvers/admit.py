"""What a solver must admit beyond its own propagation of errors.

No unbiased position is better than the ranges allow (the Cramer-Rao bound); and where the anchors
stand nearly in one line, the ranges may fit a second place on the other side of it. Moving ranges
by a standard deviation shows neither to solvers that vote or choose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs, flatness
from tablerunner.uwb.fix import FixState
from tablerunner.uwb.solvers.judge import inverse_normal
from tablerunner.uwb.solvers.nonlinear import TWO_SIDED, solve_nonlinear

_NEAREST_M = 1e-9


def at_least_the_bound(
    epochs: Epochs, place: Array, covariance: Array, used: NDArray[np.bool_]
) -> Array:
    """Return the covariance, raised to the Cramer-Rao bound where it claims to be better.

    Parameters
    ----------
    epochs : Epochs
    place : ndarray, shape (m, 2)
        [m].
    covariance : ndarray, shape (m, 2, 2)
        [m^2]; what is not finite stays as it is.
    used : ndarray of bool, shape (m, n)
        Ranges that went in.
    """
    dx = place[:, 0, None] - epochs.anchors[:, 0]
    dy = place[:, 1, None] - epochs.anchors[:, 1]
    length = np.maximum(np.sqrt(dx**2 + dy**2 + epochs.height**2), _NEAREST_M)
    jx, jy = dx / length, dy / length
    weight = np.where(used, epochs.std**-2.0, 0.0)
    bound = inverse_normal(
        np.sum(weight * jx * jx, axis=1),
        np.sum(weight * jx * jy, axis=1),
        np.sum(weight * jy * jy, axis=1),
    )
    raised: Array = np.array(covariance)
    rows = np.isfinite(bound).all(axis=(1, 2)) & np.isfinite(covariance).all(axis=(1, 2))
    root = np.linalg.cholesky(bound[rows])
    inverse = np.linalg.inv(root)
    # In units of the bound every direction has at least 1.
    values, vectors = np.linalg.eigh(inverse @ covariance[rows] @ np.swapaxes(inverse, 1, 2))
    scaled = (vectors * np.maximum(values, 1.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    raised[rows] = root @ scaled @ np.swapaxes(root, 1, 2)
    return raised


def admit_other_side(
    epochs: Epochs, place: Array, covariance: Array, state: NDArray[np.int8]
) -> tuple[Array, NDArray[np.int8]]:
    """Return covariance and state with the doubt about the side of nearly aligned anchors.

    The nonlinear solver weighs both sides. Where it leaves the side open, so must the others;
    where it does not, its covariance holds what doubt remains, and the way to its place is added
    as an error: a solver on the other side then says how far off it may be.

    Parameters
    ----------
    epochs : Epochs
    place : ndarray, shape (m, 2)
        [m].
    covariance : ndarray, shape (m, 2, 2)
        [m^2].
    state : ndarray of int8, shape (m,)
        `FixState`.
    """
    ratio, _, _ = flatness(epochs.anchors, np.isfinite(epochs.plane_ranges()))
    rows = np.flatnonzero((ratio < TWO_SIDED) & (state == FixState.SOLVED))
    if not rows.size:
        return covariance, state
    other = solve_nonlinear(epochs.some(rows))
    way = place[rows] - other.position
    doubted, judged = np.array(covariance), np.array(state)
    doubted[rows] += other.covariance + way[:, :, None] * way[:, None, :]
    judged[rows[~other.solved]] = FixState.AMBIGUOUS
    return doubted, judged
