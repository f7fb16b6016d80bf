"""Linguistic variables: a measured quantity and the words that are used for its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.control.fuzzy.membership import Membership
from tablerunner.types import Matrix, Vector


@dataclass(frozen=True, slots=True)
class FuzzySet:
    """A word and what it means."""

    name: str
    membership: Membership


@dataclass(frozen=True, slots=True)
class Variable:
    """A quantity with its words.

    Attributes
    ----------
    name : str
    low, high : float
        Its domain (Lv: basic domain); a value beyond it counts as the nearer end.
    sets : tuple of FuzzySet
    unit, description : str
        For people.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...]
    unit: str = ''
    description: str = ''

    @property
    def words(self) -> tuple[str, ...]:
        """Names of the sets."""
        return tuple(item.name for item in self.sets)

    def degrees(self, values: Vector) -> Matrix:
        """Return the degrees of membership, shape (sets, n), of values, shape (n,)."""
        inside = np.clip(values, self.low, self.high)
        return np.stack([item.membership.degrees(inside) for item in self.sets])

    def centres(self) -> Vector:
        """Return the centre of each set within the domain."""
        return np.array([item.membership.centre(self.low, self.high) for item in self.sets])

    def barest(self) -> tuple[float, float]:
        """Return the value of the domain that its words cover least, and its largest degree.

        Corners of sets and the middles between them make this exact for straight-sided sets; the
        grid is for bells.
        """
        corners = [point for item in self.sets for point in item.membership.corners]
        inner = [point for point in corners if self.low <= point <= self.high]
        points = np.unique([self.low, *inner, self.high])
        middles = 0.5 * (points[1:] + points[:-1])
        grid = np.linspace(self.low, self.high, 201)
        candidates = np.concatenate([points, middles, grid])
        best = self.degrees(candidates).max(axis=0)
        index = int(np.argmin(best))
        return float(candidates[index]), float(best[index])
