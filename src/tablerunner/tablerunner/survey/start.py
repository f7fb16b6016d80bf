"""Where an anchor may hang, from nothing but ranges along a way: multilateration.

An anchor lies on a circle about each place from which it was heard. Starts all round a few of
those circles are brought to where all ranges fit best, with weights that let go of blocked ranges.
From a straight drive two places, mirrored, fit alike: both come out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIT_M = 0.3
"""How far a range and dead reckoning may err in the beginning."""

APART_M = 0.6
"""Places nearer to each other than this are one."""

ALIKE = 0.08
"""Mean costs that differ by less do not tell places apart: a range in fifty that is off by 2 m, or
all by 8 cm."""

_DIRECTIONS = 24
_CIRCLES = 3
_ROUNDS = 20
_MOST_RANGES = 150
_LARGEST_STEP_M = 3.0


@dataclass(frozen=True)
class Places:
    """Where an anchor may hang.

    Attributes
    ----------
    place : ndarray, shape (2,)
        Where the ranges fit best [m].
    other : ndarray, shape (2,), or None
        Where they fit as well, if there is such a place.
    cost : float
        Mean of log(1 + (residual / `FIT_M`)^2).
    """

    place: Array
    other: Array | None
    cost: float


def locate_anchor(tags: Array, height_m: float, ranges: Array) -> Places:
    """Return where an anchor hangs.

    Parameters
    ----------
    tags : ndarray, shape (n, 2)
        Where the tag was, as far as is known yet [m].
    height_m : float
        Of the anchor over the tag.
    ranges : ndarray, shape (n,)
        [m].
    """
    if len(ranges) > _MOST_RANGES:
        some = np.linspace(0, len(ranges) - 1, _MOST_RANGES).astype(int)
        tags, ranges = tags[some], ranges[some]
    angles = np.arange(_DIRECTIONS) * (2.0 * np.pi / _DIRECTIONS)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    chosen = np.linspace(0, len(ranges) - 1, _CIRCLES).astype(int)
    flat = np.sqrt(np.maximum(ranges[chosen] ** 2 - height_m**2, 0.01))
    places = (tags[chosen, None] + flat[:, None, None] * ring).reshape(-1, 2)
    for _ in range(_ROUNDS):
        east, north = places[:, :1] - tags[:, 0], places[:, 1:] - tags[:, 1]
        distance = np.sqrt(east**2 + north**2 + height_m**2 + 1e-9)
        error = distance - ranges
        weight = 1.0 / (1.0 + (error / FIT_M) ** 2)
        east, north = east / distance, north / distance
        weighted = weight * east
        xx, xy = (weighted * east).sum(1) + 1e-6, (weighted * north).sum(1)
        yy = (weight * north * north).sum(1) + 1e-6
        x, y = (weighted * error).sum(1), (weight * north * error).sum(1)
        step = np.column_stack([yy * x - xy * y, xx * y - xy * x]) / (xx * yy - xy * xy)[:, None]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        places = places - step * np.minimum(1.0, _LARGEST_STEP_M / np.maximum(length, 1e-9))
    apart = np.linalg.norm(places[:, None] - tags[None], axis=2)
    error = np.sqrt(apart**2 + height_m**2) - ranges
    costs = np.mean(np.log1p((error / FIT_M) ** 2), axis=1)
    best = int(np.argmin(costs))
    rivals = (costs < costs[best] + ALIKE) & (
        np.linalg.norm(places - places[best], axis=1) > APART_M
    )
    other = None
    if rivals.any():
        other = places[np.flatnonzero(rivals)[np.argmin(costs[rivals])]]
    return Places(places[best], other, float(costs[best]))
