"""A Kalman correction by a linearised measurement of any size, in Joseph's form (Sun 32)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tablerunner.geometry.angles import wrap
from tablerunner.types import Estimate, Matrix, Vector


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
    return replace(estimate, stamp=stamp, mean=mean, covariance=0.5 * (covariance + covariance.T))
