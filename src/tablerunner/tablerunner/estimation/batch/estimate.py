"""What many filters believe, and what one measurement did to each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Estimate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BatchEstimate:
    """`Estimate` of many runs at one stamp.

    Attributes
    ----------
    mean : ndarray, shape (runs, n)
    covariance : ndarray, shape (runs, n, n)
    twist : ndarray, shape (runs, 2)
        Forward speed [m/s] and turn rate [rad/s] of the last step.
    memory : ndarray, shape (runs, m)
        Running statistics that the estimator keeps for itself.
    """

    mean: Array
    covariance: Array
    twist: Array
    memory: Array

    @classmethod
    def of(cls, estimate: Estimate, runs: int) -> BatchEstimate:
        """Return the same estimate in every run."""
        return cls(
            side_by_side(estimate.mean, runs),
            side_by_side(estimate.covariance, runs),
            side_by_side(np.array(estimate.twist), runs),
            side_by_side(np.array(estimate.memory), runs),
        )


class BatchInnovation(NamedTuple):
    """What a measurement did to each run; arrays of shape (runs,), NaN where there was none."""

    innovation: Array
    spread: Array  # variance of the innovation, S
    nis: Array
    accepted: NDArray[np.bool_]


def side_by_side(value: Array, runs: int) -> Array:
    """Return copies of an array for each run, shape (runs, ...), the runs adjacent in memory."""
    return np.moveaxis(np.repeat(value[..., None], runs, axis=-1), -1, 0)
