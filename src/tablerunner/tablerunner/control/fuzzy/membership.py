"""Fuzzy sets on a line of numbers: how much a number belongs to a word such as 'near'."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.types import Vector

LEAST_SIDE = 1e-6
"""Sides narrower than this are refused: their slope would drown in rounding, or overflow."""

LARGEST = 1e6
"""Corners beyond this are refused, for the same reason."""


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """A set that rises from 0 at `low` to 1 at `left` and falls from 1 at `right` to 0 at `high`.

    A triangle has ``left == right``; a shoulder has a side at infinity, where it stays 1.
    """

    low: float
    left: float
    right: float
    high: float

    def __post_init__(self) -> None:
        """Refuse sides that are upright or upside down.

        Raises
        ------
        ValueError
        """
        rises = self.left - self.low >= LEAST_SIDE or self.left == -math.inf
        falls = self.high - self.right >= LEAST_SIDE or self.right == math.inf
        if not (rises and falls and self.left <= self.right):
            raise ValueError(f'corners that go up, with sides at least {LEAST_SIDE:g} wide')
        if any(abs(corner) > LARGEST for corner in self.corners):
            raise ValueError(f'corners from {-LARGEST:g} to {LARGEST:g}')

    @property
    def corners(self) -> tuple[float, ...]:
        """Where the slope changes; infinite ones left out."""
        points = (self.low, self.left, self.right, self.high)
        return tuple(dict.fromkeys(point for point in points if math.isfinite(point)))

    def degrees(self, values: Vector) -> Vector:
        """Return the degree of membership, 0..1, of each value."""
        rising, falling = self.sides()
        sides = np.minimum(
            rising[0] * values + rising[1],
            falling[0] * values + falling[1],
        )
        return np.clip(sides, 0.0, 1.0)

    def sides(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return slope and offset of the rising and of the falling side's line."""
        rising = falling = (0.0, 1.0)
        if math.isfinite(self.left):
            slope = 1.0 / (self.left - self.low)
            rising = (slope, -self.low * slope)
        if math.isfinite(self.right):
            slope = 1.0 / (self.high - self.right)
            falling = (-slope, self.high * slope)
        return rising, falling

    def centre(self, low: float, high: float) -> float:
        """Return the middle of where the set is 1 within a domain: its centre in Lv (12)."""
        return 0.5 * (max(self.left, low) + min(self.right, high))


@dataclass(frozen=True, slots=True)
class Gaussian:
    """A bell: ``exp(-((x - mean) / std)^2 / 2)``."""

    mean: float
    std: float

    def __post_init__(self) -> None:
        """Refuse a bell without width.

        Raises
        ------
        ValueError
        """
        if not (abs(self.mean) <= LARGEST and LEAST_SIDE <= self.std <= LARGEST):
            words = f'mean to {LARGEST:g}, standard deviation from {LEAST_SIDE:g} to {LARGEST:g}'
            raise ValueError(f'a bell with a {words}')

    @property
    def corners(self) -> tuple[float, ...]:
        """Where it is 1."""
        return (self.mean,)

    def degrees(self, values: Vector) -> Vector:
        """Return the degree of membership, 0..1, of each value."""
        return np.asarray(np.exp(-0.5 * ((values - self.mean) / self.std) ** 2))

    def centre(self, low: float, high: float) -> float:
        """Return the place within a domain where the set is largest."""
        return min(max(self.mean, low), high)


Membership = Trapezoid | Gaussian


def triangle(low: float, peak: float, high: float) -> Trapezoid:
    """Return a set that is 1 only at its peak."""
    return Trapezoid(low, peak, peak, high)


def left_shoulder(right: float, high: float) -> Trapezoid:
    """Return a set that is 1 up to `right` and falls to 0 at `high`."""
    return Trapezoid(-math.inf, -math.inf, right, high)


def right_shoulder(low: float, left: float) -> Trapezoid:
    """Return a set that is 0 up to `low` and rises to stay 1 from `left` on."""
    return Trapezoid(low, left, math.inf, math.inf)
