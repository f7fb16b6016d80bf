"""Weights of particles, as logarithms: a likelihood of 1e-400 is a number like any other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tablerunner.types import Vector


class Normalised(NamedTuple):
    """Weights that add up to one.

    Attributes
    ----------
    log_weights : ndarray, shape (n,)
    log_sum : float
        Logarithm of what they added up to before; -inf where nothing was left.
    recovered : bool
        Whether no weight was above zero (or none was a number): all count alike then.
    """

    log_weights: Vector
    log_sum: float
    recovered: bool


def normalised(log_weights: Vector) -> Normalised:
    """Return log weights that add up to one; NaN counts as no weight at all."""
    known = np.where(np.isnan(log_weights), -np.inf, log_weights)
    most = float(known.max())
    if not np.isfinite(most):
        even = np.full(len(known), -np.log(len(known)))
        return Normalised(even, -np.inf, True)
    log_sum = most + float(np.log(np.sum(np.exp(known - most))))
    return Normalised(known - log_sum, log_sum, False)


def effective_size(log_weights: Vector) -> float:
    """Return how many particles of equal weight tell as much: 1 / sum of squares (Kong 1994).

    Parameters
    ----------
    log_weights : ndarray, shape (n,)
        Normalised.
    """
    return float(1.0 / np.sum(np.exp(2.0 * log_weights)))
