"""What every solver returns: positions of many epochs, and how far to believe them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

Array = NDArray[np.float64]

PLANE_UNKNOWNS = 2
"""Coordinates that a fix in the plane determines."""


class FixState(IntEnum):
    """Whether an epoch has a position, and why not."""

    SOLVED = 0
    TOO_FEW = 1
    IN_LINE = 2
    AMBIGUOUS = 3
    NO_MEETING = 4
    NOT_CONVERGED = 5

    @property
    def reason(self) -> str:
        """The state in words that stay the same, so that they can be counted."""
        return _REASONS[self]


_REASONS = {
    FixState.SOLVED: 'solved',
    FixState.TOO_FEW: 'too few ranges in an epoch',
    FixState.IN_LINE: 'anchors in one line',
    FixState.AMBIGUOUS: 'ranges leave the position open',
    FixState.NO_MEETING: 'ranges contradict each other: circles do not meet',
    FixState.NOT_CONVERGED: 'no minimum found',
}


@dataclass(frozen=True)
class PositionFix:
    """Positions of m epochs from ranges to n anchors.

    An epoch without an answer is NaN in every float array, and its `state` says why.

    Attributes
    ----------
    position : ndarray, shape (m, 2)
        Tag in map [m].
    covariance : ndarray, shape (m, 2, 2)
        What the standard deviations of the ranges make of the position [m^2].
    used_mask : ndarray of bool, shape (m, n)
        Which ranges went into the position.
    residual_rms : ndarray, shape (m,)
        Root mean square of the residuals of the used ranges, in three dimensions [m].
    chi_square : ndarray, shape (m,)
        Sum of the used residuals' squares over their variances.
    gdop : ndarray, shape (m,)
        Geometric dilution of precision of the used anchors at the position: error of the position
        [m] per metre of error of the ranges, had they been solved by least squares.
    state : ndarray of int8, shape (m,)
        `FixState` of each epoch.
    """

    position: Array
    covariance: Array
    used_mask: NDArray[np.bool_]
    residual_rms: Array
    chi_square: Array
    gdop: Array
    state: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.position)

    @property
    def used(self) -> NDArray[np.int64]:
        """How many ranges went into each position, shape (m,)."""
        return np.asarray(self.used_mask.sum(axis=1))

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Which epochs have a position, shape (m,)."""
        return np.asarray(self.state == FixState.SOLVED)

    @property
    def excess(self) -> Array:
        """Chi-square per surplus range, at least 1; 1 where no range is to spare; shape (m,).

        More scatter than the ranges' own noise explains is NLOS or bias. Multiplied with this, a
        covariance owns up to it.
        """
        spare = np.maximum(self.used - PLANE_UNKNOWNS, 1)
        return np.fmax(self.chi_square / spare, 1.0)

    @property
    def p_value(self) -> Array:
        """Probability that noise alone makes residuals as large as these, shape (m,).

        The chi-square residual test: a small value says that some range is not what its standard
        deviation claims. NaN where no range is to spare.
        """
        spare = self.used - PLANE_UNKNOWNS
        with np.errstate(invalid='ignore'):
            value = chdtrc(np.maximum(spare, 1), self.chi_square)
        return np.asarray(np.where(spare > 0, value, np.nan))

    def consistent(self, significance: float = 0.001) -> NDArray[np.bool_]:
        """Return which epochs pass the residual test, shape (m,); True where none is possible.

        Parameters
        ----------
        significance : float
            Share of epochs with honest noise that may fail.
        """
        return self.solved & ~(self.p_value < significance)


def join_fixes(parts: Sequence[PositionFix]) -> PositionFix:
    """Return several fixes, of ranges to the same anchors, as one."""
    return PositionFix(
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.covariance for part in parts]),
        np.concatenate([part.used_mask for part in parts]),
        np.concatenate([part.residual_rms for part in parts]),
        np.concatenate([part.chi_square for part in parts]),
        np.concatenate([part.gdop for part in parts]),
        np.concatenate([part.state for part in parts]),
    )
