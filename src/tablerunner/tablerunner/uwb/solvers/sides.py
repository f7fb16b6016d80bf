"""Two places explain the ranges of an epoch: which to take, and what to admit of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array

OPEN_ABOVE = 0.4
"""Probability of the other side above which neither is taken."""

_APART_SIGMAS = 3.0  # closer together, the covariance covers both places anyway


@dataclass(frozen=True)
class Sides:
    """The likelier of two places in each of m epochs.

    Attributes
    ----------
    place : ndarray, shape (2, m)
        The likelier place [m].
    offset : ndarray, shape (2, m)
        From there to the other [m].
    doubt : ndarray, shape (m,)
        Probability of the other place, at most 0.5.
    """

    place: Array
    offset: Array
    doubt: Array

    @property
    def spread(self) -> Array:
        """What the doubt adds to the covariance about `place` [m^2], shape (m, 2, 2)."""
        return np.asarray(np.einsum('m,im,jm->mij', self.doubt, self.offset, self.offset))

    def open(self, covariance: Array) -> NDArray[np.bool_]:
        """Return in which epochs the side stays open, shape (m,).

        Parameters
        ----------
        covariance : ndarray, shape (m, 2, 2)
            Of the place, were its side known: places within 3 standard deviations of each other
            are as good as one.
        """
        square = np.sum(self.offset**2, axis=0)
        along = np.einsum('im,mij,jm->m', self.offset, covariance, self.offset)
        with np.errstate(invalid='ignore'):
            return np.asarray((self.doubt > OPEN_ABOVE) & ~(square**2 <= _APART_SIGMAS**2 * along))


def weigh_sides(places: Array, costs: Array, spare: NDArray[np.int64]) -> Sides:
    """Return the likelier of two places per epoch.

    Parameters
    ----------
    places : ndarray, shape (2, 2, m)
        Which of both, x and y, epoch [m].
    costs : ndarray, shape (2, m)
        Chi-square (minus twice the log likelihood) of each; inf where there is no such place.
    spare : ndarray of int, shape (m,)
        Ranges more than needed. Where residuals are larger than noise explains, the costs
        discriminate less by the same factor.
    """
    second = costs[1] < costs[0]
    place = np.where(second, places[1], places[0])
    other = np.where(second, places[0], places[1])
    best, worse = np.minimum(costs[0], costs[1]), np.maximum(costs[0], costs[1])
    excess = np.maximum(best / np.maximum(spare, 1), 1.0)
    with np.errstate(invalid='ignore'):
        margin = np.where(np.isfinite(worse), (worse - best) / (2.0 * excess), np.inf)
    doubt = 1.0 / (1.0 + np.exp(np.minimum(margin, 700.0)))
    offset = np.where(np.isfinite(worse), other - place, 0.0)
    return Sides(place, offset, doubt)
