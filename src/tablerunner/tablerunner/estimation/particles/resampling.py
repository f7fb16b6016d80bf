"""Which particles go on, each in proportion to its weight.

==============  ===================================================================================
multinomial     independent draws (the paper's): counts are multinomial
systematic      one draw, then equal steps (Kitagawa 1996): each count is the floor or the ceiling
                of n w
residual        the floor of n w for certain, the rest drawn (Liu and Chen 1998)
==============  ===================================================================================

Every count has the expectation n w under each of them (Douc, Cappe and Moulines 2005).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Vector

Indices = NDArray[np.intp]

Resampler = Callable[[Vector, int, np.random.Generator], Indices]
"""Takes weights, shape (n,), that add up to one; returns which of them go on, shape (count,)."""


def multinomial(weights: Vector, count: int, rng: np.random.Generator) -> Indices:
    """Return independent draws."""
    return _at(weights, rng.random(count))


def systematic(weights: Vector, count: int, rng: np.random.Generator) -> Indices:
    """Return draws at equal steps from one random place."""
    return _at(weights, (np.arange(count) + rng.random()) / count)


def residual(weights: Vector, count: int, rng: np.random.Generator) -> Indices:
    """Return the whole part of `count` times each weight, and draws of what is left over."""
    share = count * weights
    # Half a unit in the last place must not cost a particle that is due.
    whole = np.floor(share + 1e-9).astype(np.intp)
    certain = np.repeat(np.arange(len(weights)), whole)
    left = count - len(certain)
    if left <= 0:
        return certain[:count]
    rest = np.maximum(share - whole, 0.0)
    return np.concatenate([certain, multinomial(rest / rest.sum(), left, rng)])


RESAMPLERS: Mapping[str, Resampler] = MappingProxyType(
    {'multinomial': multinomial, 'systematic': systematic, 'residual': residual}
)


def _at(weights: Vector, places: Vector) -> Indices:
    """Return into whose share of 0..1 each place falls."""
    edges = np.cumsum(weights)
    edges /= edges[-1]  # rounding must leave no gap at the end
    return np.searchsorted(edges, places, side='right')
