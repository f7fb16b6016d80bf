"""I + V V' of many small V: its Cholesky factor, what it solves, and its inverse's square root.

LAPACK takes one matrix at a time, and for matrices of three rows its calls take longer than the
arithmetic. So up to `SMALL` states the formulas are written out, each number an array over the
matrices; beyond, NumPy's loop over LAPACK does it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Matrix, Vector

SMALL = 4

Array = NDArray[np.float64]
_Factor = list[list[Vector]]


def solved(slope: Array, pull: Matrix) -> Matrix:
    """Return (I + V V')^-1 pull, shape (k, d).

    Parameters
    ----------
    slope : ndarray, shape (k, m, d)
        V'.
    pull : ndarray, shape (k, d)
    """
    if slope.shape[1] == 1:  # one number: Sherman and Morrison, without any matrix
        v = slope[:, 0]
        share = np.sum(v * pull, axis=1) / (1.0 + np.sum(v * v, axis=1))
        return np.asarray(pull - share[:, None] * v)
    size = slope.shape[2]
    if size > SMALL:
        return np.asarray(np.linalg.solve(curvature(slope), pull[..., None])[..., 0])
    factor = _factor(slope)
    forward: list[Vector] = []
    for i in range(size):
        rest = pull[:, i]
        for j in range(i):
            rest = rest - factor[i][j] * forward[j]
        forward.append(rest / factor[i][i])
    found = np.empty_like(pull)
    for i in reversed(range(size)):
        rest = forward[i]
        for j in range(i + 1, size):
            rest = rest - factor[j][i] * found[:, j]
        found[:, i] = rest / factor[i][i]
    return found


def spread(slope: Array) -> tuple[Array, Vector]:
    """Return B of B B' = (I + V V')^-1, shape (k, d, d), and the log of its determinant, (k,).

    Parameters
    ----------
    slope : ndarray, shape (k, m, d)
        V'.
    """
    size = slope.shape[2]
    if slope.shape[1] == 1:
        v = slope[:, 0]
        square = np.sum(v * v, axis=1)
        # (I + v v')^-1/2 = I - c v v' with c = (1 - 1/sqrt(1 + v'v)) / v'v, written so that a v of
        # no length is no trouble.
        grown = np.sqrt(1.0 + square)
        share = 1.0 / (grown * (grown + 1.0))
        return np.eye(size) - (share[:, None] * v)[:, :, None] * v[:, None, :], -np.log(grown)
    if size > SMALL:
        root = np.linalg.cholesky(curvature(slope))
        log_size = -np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        return np.swapaxes(np.linalg.inv(root), -1, -2), np.asarray(log_size)
    factor = _factor(slope)
    half = np.zeros((len(slope), size, size))
    volume = np.ones(len(slope))
    for i in range(size):
        own = 1.0 / factor[i][i]
        half[:, i, i] = own
        volume *= own
        for j in range(i):
            # Row i of the inverse of the factor, which is column i of B.
            total = factor[i][j] * half[:, j, j]
            for k in range(j + 1, i):
                total = total + factor[i][k] * half[:, j, k]
            half[:, j, i] = -own * total
    return half, np.log(volume)


def times(matrices: Array, vectors: Matrix) -> Matrix:
    """Return each matrix times its vector, shape (k, m).

    Parameters
    ----------
    matrices : ndarray, shape (k, m, d)
    vectors : ndarray, shape (k, d)
    """
    size = vectors.shape[1]
    if size > SMALL:
        return np.asarray((matrices @ vectors[..., None])[..., 0])
    total = matrices[:, :, 0] * vectors[:, :1]
    for j in range(1, size):
        total += matrices[:, :, j] * vectors[:, j : j + 1]
    return np.asarray(total)


def curvature(slope: Array) -> Array:
    """Return I + V V', shape (k, d, d)."""
    return np.asarray(np.eye(slope.shape[-1]) + np.swapaxes(slope, -1, -2) @ slope)


def _factor(slope: Array) -> _Factor:
    """Return the Cholesky factor of I + V V', each number as an array over the matrices."""
    size = slope.shape[2]
    columns = [np.ascontiguousarray(slope[:, :, i]) for i in range(size)]
    factor: _Factor = []
    for i in range(size):
        row: list[Vector] = []
        for j in range(i + 1):
            value = np.einsum('km,km->k', columns[i], columns[j])
            if i == j:
                value += 1.0
            for k in range(j):
                value -= row[k] * (factor[j][k] if j < i else row[k])
            row.append(np.sqrt(value) if i == j else value / factor[j][j])
        factor.append(row)
    return factor
