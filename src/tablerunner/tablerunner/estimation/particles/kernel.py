"""Regularisation: equal particles are moved apart (Musso, Oudjane and Le Gland 2001).

Resampling copies particles, and copies stay copies where the motion has little noise. The
regularised filter draws from a smooth density instead, a kernel about each particle: x + h A e,
with A A' the covariance of all particles, e standard normal, and the bandwidth

    h = (4 / (n (d + 2)))^(1 / (d + 4))

which is optimal (in mean integrated square error) for a Gaussian kernel and a Gaussian density
of d dimensions. It widens the density: its covariance grows by the factor 1 + h^2.
"""

from __future__ import annotations

import numpy as np

from tablerunner.types import Matrix


def bandwidth(count: int, dimensions: int) -> float:
    """Return the optimal bandwidth of a Gaussian kernel, in deviations of the density."""
    return float((4.0 / (count * (dimensions + 2.0))) ** (1.0 / (dimensions + 4.0)))


def square_root(covariance: Matrix) -> Matrix:
    """Return A of A A' = covariance, shape (..., n, n); singular ones are no trouble to it."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def regularised(states: Matrix, covariance: Matrix, rng: np.random.Generator) -> Matrix:
    """Return the states moved apart by the optimal kernel.

    Parameters
    ----------
    states : ndarray, shape (n, d)
        After resampling.
    covariance : ndarray, shape (d, d)
        Of the particles before it.
    rng : Generator
    """
    width = bandwidth(*states.shape)
    noise = rng.standard_normal(states.shape)
    return np.asarray(states + width * noise @ square_root(covariance).T)
