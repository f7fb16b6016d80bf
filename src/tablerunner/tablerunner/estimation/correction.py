"""A Kalman correction by a linearised measurement of any size, in Joseph's form (Sun 32)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.angles import wrap
from tablerunner.types import Estimate, Matrix, Vector

Flags = NDArray[np.bool_]


class Expected(NamedTuple):
    """How far a measurement is off what was expected, and how far it may be."""

    innovation: Vector  # (m,)
    slope: Matrix  # (m, n), d(measurement)/d(state)
    noise: Matrix  # (m, m)
    spread: Matrix  # (m, m), S
    nis: float


def expect(covariance: Matrix, innovation: Vector, slope: Matrix, noise: Matrix) -> Expected:
    """Return the innovation with its covariance S = H P H' + R and its normalised square."""
    spread = slope @ covariance @ slope.T + noise
    nis = float(innovation @ np.linalg.solve(spread, innovation))
    return Expected(innovation, slope, noise, spread, nis)


def correct(estimate: Estimate, expected: Expected, stamp: int) -> Estimate:
    """Return the estimate corrected by the measurement; the third state is an angle."""
    gain = np.linalg.solve(expected.spread, expected.slope @ estimate.covariance).T
    mean = estimate.mean + gain @ expected.innovation
    mean[2] = wrap(float(mean[2]))
    keep = np.eye(len(mean)) - gain @ expected.slope
    covariance = keep @ estimate.covariance @ keep.T + gain @ expected.noise @ gain.T
    return estimate._replace(stamp=stamp, mean=mean, covariance=0.5 * (covariance + covariance.T))


class CorrectedByOne(NamedTuple):
    """What a single number did to a state, or to many states at once."""

    mean: Matrix  # (..., n)
    covariance: Matrix  # (..., n, n)
    spread: Vector  # (...), S


def correct_by_one(
    mean: Matrix,
    covariance: Matrix,
    innovation: Vector,
    slope: Matrix,
    noise: float | Vector,
    used: Flags | None = None,
) -> CorrectedByOne:
    """Return the state corrected by one number, in Joseph's form (Sun 32), for any leading axes.

    (I - K H) P (I - K H)' + K R K' with its products of rank one written out: with
    A = P - K (H P), the rest is A - (A H' - K R) K'.

    Parameters
    ----------
    mean : ndarray, shape (..., n)
        The third state is an angle.
    covariance : ndarray, shape (..., n, n)
    innovation : ndarray, shape (...)
    slope : ndarray, shape (..., n)
        d(measurement)/d(state).
    noise : float or ndarray, shape (...)
        Variance of the number.
    used : ndarray of bool, shape (...), optional
        States that are not corrected stay as they are; all are when not given.
    """
    cross = np.einsum('...ij,...j->...i', covariance, slope)
    along = np.einsum('...i,...i->...', slope, cross)
    return _by_one(mean, covariance, innovation, slope, _Row(cross, along, noise), used)


def correct_state(
    mean: Matrix,
    covariance: Matrix,
    innovation: Vector,
    index: int,
    noise: float | Vector,
    used: Flags | None = None,
) -> CorrectedByOne:
    """Return the state corrected by a measurement of one of its numbers itself.

    Parameters
    ----------
    index : int
        Which number.
    mean, covariance, innovation, noise, used
        As for `correct_by_one`.
    """
    cross = covariance[..., :, index]
    row = _Row(cross, cross[..., index], noise)
    return _by_one(mean, covariance, innovation, index, row, used)


class _Row(NamedTuple):
    cross: Matrix  # (..., n), P H'
    along: Vector  # (...), H P H'
    noise: float | Vector


def _by_one(
    mean: Matrix,
    covariance: Matrix,
    innovation: Vector,
    slope: Matrix | int,
    row: _Row,
    used: Flags | None,
) -> CorrectedByOne:
    spread = np.asarray(row.along + row.noise)
    gain = row.cross / spread[..., None]
    if used is not None:
        gain = np.where(used[..., None], gain, 0.0)
        innovation = np.where(used, innovation, 0.0)
    left = covariance - gain[..., :, None] * row.cross[..., None, :]
    if isinstance(slope, int):
        pulled = left[..., :, slope].copy(order='K')
    else:
        pulled = np.einsum('...ij,...j->...i', left, slope)
    pulled -= gain * np.asarray(row.noise)[..., None]
    left -= pulled[..., :, None] * gain[..., None, :]
    moved = mean + gain * innovation[..., None]
    moved[..., 2] = wrap(moved[..., 2])
    return CorrectedByOne(moved, 0.5 * (left + np.swapaxes(left, -1, -2)), spread)
