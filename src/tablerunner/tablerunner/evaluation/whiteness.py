"""Whether the innovations of a filter are white: what is left of one says nothing of the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablerunner.types import Vector


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Correlation of successive normalised innovations, and how far from zero it may be.

    Attributes
    ----------
    pairs : int
        How many successive ones there were.
    correlation : float
        At a lag of one; NaN without pairs.
    bound : float
        Two-sided 95 % bound of its size for white innovations.
    """

    pairs: int
    correlation: float
    bound: float

    @property
    def holds(self) -> bool:
        """Whether the correlation lies inside its bound."""
        return abs(self.correlation) <= self.bound


def lag_one(normalised: Vector, keys: Sequence[str]) -> Whiteness:
    """Return the correlation of each innovation with the next of the same key, over all keys.

    An error that stays, as a range bias does, shows in successive ranges of one anchor; between
    anchors it would cancel. (Bar-Shalom, Li, Kirubarajan 2001, eq. 5.4.2-13: the bound is
    1.96 / sqrt(pairs).)

    Parameters
    ----------
    normalised : ndarray, shape (n,)
        Innovations over their deviations, in order of time.
    keys : sequence of str
        Which of the series each belongs to, as an anchor.
    """
    names = np.asarray(keys, dtype=str)
    product, square, pairs = 0.0, 0.0, 0
    for name in np.unique(names):
        own = normalised[names == name]
        product += float(own[1:] @ own[:-1])
        square += math.sqrt(float(own[1:] @ own[1:]) * float(own[:-1] @ own[:-1]))
        pairs += max(len(own) - 1, 0)
    if not pairs or square == 0.0:
        return Whiteness(pairs, math.nan, math.nan)
    return Whiteness(pairs, product / square, 1.96 / math.sqrt(pairs))
