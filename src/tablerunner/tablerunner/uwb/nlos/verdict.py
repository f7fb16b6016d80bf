"""What every test for blocked ranges says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NlosVerdict:
    """How likely ranges are not line of sight.

    Attributes
    ----------
    probability : ndarray, any shape
        In [0, 1]; NaN where the test has no say.
    blocked : ndarray of bool, same shape
        The decision: False where the test has no say.
    """

    probability: Array
    blocked: NDArray[np.bool_]

    @classmethod
    def of(cls, probability: ArrayLike, threshold: float = 0.5) -> NlosVerdict:
        """Return the verdict that calls a range blocked above a probability."""
        value = np.asarray(probability, dtype=float)
        with np.errstate(invalid='ignore'):
            return cls(value, np.asarray(value > threshold))


def logistic(value: ArrayLike) -> Array:
    """Return 1 / (1 + exp(-value)), without overflow; NaN passes through."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(np.asarray(value, dtype=float), -50, 50))))
