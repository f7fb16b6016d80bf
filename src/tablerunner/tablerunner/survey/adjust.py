"""Robust nonlinear least squares over a sparse Jacobian, with the noise of each group found too.

Levenberg and Marquardt's damping on the normal equations, which are sparse and solved exactly: a
trajectory is a long chain, on which the iterative solver of `scipy.optimize.least_squares` (LSMR)
takes thousands of steps. Residuals come whitened by what is believed of their noise and in groups.
How much larger or smaller the noise of a group really is (its factor) is found as Helmert and
Förstner do: squared residuals over their share of the redundancy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from tablerunner.errors import GeometryError

Array = NDArray[np.float64]

CAUCHY = 2.385
TUKEY = 4.685
"""Where the weights fall, in standard deviations: 95 % efficient on normal errors."""

PRIOR = 0
"""The group of residuals whose noise is taken as it is."""

MAD_TO_SIGMA = 1.4826

_STEPS = 40
_SMALL = 1e-7
_FACTOR_ROUNDS = 8
_ROWS_AT_ONCE = 2000
_NEAR = 3.0
_FACTOR_LIMITS = (0.25, 50.0)
"""Where the data hardly tell the noise of a group it may come out as nothing, and certainty as too
large: it is never believed to be more than four times smaller than was said."""


@dataclass(frozen=True)
class Rows:
    """Residuals and their derivatives at one place.

    Attributes
    ----------
    residual : ndarray, shape (m,)
        Of size one, as far as their noise is known.
    jacobian : csr_matrix, shape (m, n)
    group : ndarray of int, shape (m,)
        `PRIOR` for residuals whose noise is known.
    """

    residual: Array
    jacobian: csr_matrix
    group: NDArray[np.intp]


@dataclass(frozen=True)
class Adjusted:
    """What came out.

    Attributes
    ----------
    values : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
        Zero where a value was held.
    factors : ndarray, shape (groups,)
        By how much the noise of each group is larger than was believed.
    weights : ndarray, shape (m,)
        Of the residuals; 1 where they are not robust.
    residuals : ndarray, shape (m,)
        Over the noise that was found.
    settled : bool
        Whether the last step was small.
    """

    values: Array
    covariance: Array
    factors: Array
    weights: Array
    residuals: Array
    settled: bool


@dataclass(frozen=True)
class Kinds:
    """How the groups are treated.

    Attributes
    ----------
    count : int
        Of groups, `PRIOR` included.
    found : frozenset of int
        Groups whose noise is found; that of others is taken as given.
    robust : frozenset of int
        Groups with blunders: Tukey's weights in the end, their noise from the median.
    doubtful : frozenset of int
        Groups that err by more than their noise now and then (slips): Cauchy's weights.
    """

    count: int
    found: frozenset[int] = frozenset()
    robust: frozenset[int] = frozenset()
    doubtful: frozenset[int] = frozenset()


def adjust(
    rows_at: Callable[[Array], Rows],
    start: Array,
    free: NDArray[np.bool_],
    kinds: Kinds,
    factors: Array | None = None,
    find_factors: bool = True,
) -> Adjusted:
    """Return the values that fit best, their covariance, and the noise of the groups.

    Parameters
    ----------
    rows_at : callable
        Residuals and Jacobian at values, shape (n,).
    start : ndarray, shape (n,)
    free : ndarray of bool, shape (n,)
        Which values are looked for; the others are held.
    kinds : Kinds
    factors : ndarray, shape (groups,), optional
        To start with; ones when not given.
    find_factors : bool
        Whether the noise of the groups is found, too; else it is taken as given.

    Raises
    ------
    GeometryError
        The residuals do not settle the values.
    """
    values = start.astype(float).copy()
    known = np.ones(kinds.count) if factors is None else factors.astype(float).copy()
    values, settled = _descend(rows_at, values, free, kinds, known, redescending=False)
    if not find_factors:
        rows = rows_at(values)
        scaled = rows.residual / known[rows.group]
        weights = _weights(scaled, rows.group, kinds, False)
        inverse = _inverse(rows, weights, known, free)
        return Adjusted(values, _full(inverse, free), known, weights, scaled, settled)
    for _ in range(_FACTOR_ROUNDS):
        before = known.copy()
        known = _factors(rows_at(values), free, kinds, known)
        values, settled = _descend(rows_at, values, free, kinds, known, redescending=True)
        if np.all(np.abs(np.log(known / before)) < 0.05):
            break
    rows = rows_at(values)
    scaled = rows.residual / known[rows.group]
    weights = _weights(scaled, rows.group, kinds, True)
    covariance = _full(_inverse(rows, weights, known, free), free)
    return Adjusted(values, covariance, known, weights, scaled, settled)


def _descend(
    rows_at: Callable[[Array], Rows],
    values: Array,
    free: NDArray[np.bool_],
    kinds: Kinds,
    factors: Array,
    redescending: bool,
) -> tuple[Array, bool]:
    """Return better values, and whether they settled."""
    damping = 1e-6
    rows = rows_at(values)
    cost = _cost(rows, kinds, factors, redescending)
    for _ in range(_STEPS):
        scaled = rows.residual / factors[rows.group]
        weight = _weights(scaled, rows.group, kinds, redescending)
        jacobian = diags(np.sqrt(weight) / factors[rows.group]) @ rows.jacobian[:, free]
        normal = (jacobian.T @ jacobian).tocsc()
        gradient = jacobian.T @ (np.sqrt(weight) * scaled)
        diagonal = np.maximum(normal.diagonal(), 1e-12)
        while True:
            try:
                step = splu((normal + diags(damping * diagonal)).tocsc()).solve(gradient)
            except RuntimeError as error:
                raise GeometryError('the measurements do not settle the answer') from error
            trial = values.copy()
            trial[free] -= step
            new = rows_at(trial)
            lower = _cost(new, kinds, factors, redescending)
            if np.isfinite(lower) and lower <= cost * (1.0 + 1e-12):
                break
            damping = max(10.0 * damping, 1e-6)
            if damping > 1e8:
                return values, True
        change = float(np.max(np.abs(step), initial=0.0))
        gained = cost - lower
        values, rows, cost = trial, new, lower
        damping = max(0.1 * damping, 1e-9)
        if change < _SMALL or gained < 1e-9 * max(cost, 1.0):
            return values, True
    return values, False


def _weights(scaled: Array, group: NDArray[np.intp], kinds: Kinds, redescending: bool) -> Array:
    weight = np.ones_like(scaled)
    for number in kinds.robust | kinds.doubtful:
        own = group == number
        if redescending and number in kinds.robust:
            ratio = np.clip((scaled[own] / TUKEY) ** 2, 0.0, 1.0)
            weight[own] = (1.0 - ratio) ** 2
        else:
            weight[own] = 1.0 / (1.0 + (scaled[own] / CAUCHY) ** 2)
    return weight


def _cost(rows: Rows, kinds: Kinds, factors: Array, redescending: bool) -> float:
    scaled = rows.residual / factors[rows.group]
    cost = scaled**2
    for number in kinds.robust | kinds.doubtful:
        own = rows.group == number
        if redescending and number in kinds.robust:
            ratio = np.clip((scaled[own] / TUKEY) ** 2, 0.0, 1.0)
            cost[own] = TUKEY**2 / 3.0 * (1.0 - (1.0 - ratio) ** 3)
        else:
            cost[own] = CAUCHY**2 * np.log1p((scaled[own] / CAUCHY) ** 2)
    return float(cost.sum())


def _inverse(rows: Rows, weight: Array, factors: Array, free: NDArray[np.bool_]) -> Array:
    jacobian = diags(np.sqrt(weight) / factors[rows.group]) @ rows.jacobian[:, free]
    normal = (jacobian.T @ jacobian).toarray()
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError as error:
        raise GeometryError('the measurements do not settle the answer') from error
    return np.asarray(0.5 * (inverse + inverse.T))


def _factors(rows: Rows, free: NDArray[np.bool_], kinds: Kinds, factors: Array) -> Array:
    """Return the noise of each group over what was believed."""
    scaled = rows.residual / factors[rows.group]
    weight = _weights(scaled, rows.group, kinds, True)
    inverse = _inverse(rows, weight, factors, free)
    leverage = _leverage(rows.jacobian[:, free], inverse) * weight / factors[rows.group] ** 2
    found: Array = factors.copy()
    for number in kinds.found:
        own = rows.group == number
        if not own.any():
            continue
        redundancy = max(float(np.sum(1.0 - leverage[own])), 1.0)
        if number in kinds.robust or number in kinds.doubtful:
            size = np.abs(scaled[own])
            if number in kinds.robust:
                # From what lies below the middle: nothing that stands in the way makes a range
                # short. Blunders that are known by now do not shift the middle.
                near = scaled[own][size < _NEAR]
                middle = np.median(near) if len(near) else 0.0
                size = middle - near[near < middle]
            if not len(size):
                continue
            std = MAD_TO_SIGMA * float(np.median(size) * np.sqrt(own.sum() / redundancy))
        else:
            std = float(np.sqrt(np.sum(scaled[own] ** 2) / redundancy))
        found[number] = np.clip(factors[number] * std, *_FACTOR_LIMITS)
    return found


def _leverage(jacobian: csr_matrix, inverse: Array) -> Array:
    """Return j C j' of each row j, some rows at a time: they are long and nearly empty."""
    parts = []
    for begin in range(0, jacobian.shape[0], _ROWS_AT_ONCE):
        part = jacobian[begin : begin + _ROWS_AT_ONCE]
        parts.append(np.einsum('ij,ij->i', part @ inverse, part.toarray()))
    return np.concatenate(parts)


def _full(inverse: Array, free: NDArray[np.bool_]) -> Array:
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = inverse
    return covariance
