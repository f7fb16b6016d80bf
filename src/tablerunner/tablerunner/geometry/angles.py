"""Angles on the circle, in radians, counter-clockwise."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from numpy.typing import NDArray

TWO_PI = 2.0 * math.pi


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]: ...
def wrap(angle: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """Return the same direction in (-pi, pi]."""
    if isinstance(angle, np.ndarray):
        wrapped = np.mod(angle + math.pi, TWO_PI) - math.pi
        return np.where(wrapped == -math.pi, math.pi, wrapped)
    turned = math.remainder(angle, TWO_PI)
    return math.pi if turned == -math.pi else turned


def difference(to: float, start: float) -> float:
    """Return the smallest signed turn that leads from `start` to `to`, in (-pi, pi]."""
    return wrap(to - start)


def circular_mean(
    angles: NDArray[np.float64], weights: NDArray[np.float64] | None = None
) -> float:
    """Return the direction of the (weighted) mean unit vector of `angles`, shape (n,)."""
    weighting = np.ones_like(angles) if weights is None else weights
    return math.atan2(
        float(np.sum(weighting * np.sin(angles))), float(np.sum(weighting * np.cos(angles)))
    )
