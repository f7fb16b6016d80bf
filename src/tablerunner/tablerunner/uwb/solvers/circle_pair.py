"""Two circles in the tag's plane: where they meet, or nearly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs

GAP_SIGMAS = 5.0
"""Circles that miss each other by less, in deviations of both radii, count as touching."""

_NEAREST_CENTRES_M = 1e-3


@dataclass(frozen=True)
class CirclePair:
    """Intersections of m pairs of circles.

    Attributes
    ----------
    first, second : ndarray, shape (m, 2)
        Left and right of the way from the first centre to the second [m]; one point where the
        circles miss each other; NaN for circles about one centre.
    gap : ndarray, shape (m,)
        By how much they miss each other [m]; 0 where they meet.
    """

    first: Array
    second: Array
    gap: Array


def intersect(
    centre_a: Array, centre_b: Array, radius_a: Array, radius_b: Array, chord: bool = False
) -> CirclePair:
    """Return where circles meet.

    Parameters
    ----------
    centre_a, centre_b : ndarray, shape (2,) or (m, 2)
    radius_a, radius_b : ndarray, shape (m,)
        NaN passes through.
    chord : bool
        The point of circles that miss each other: on the common chord, the line of equal
        difference of squares, which goes on beyond both; otherwise in the middle of the gap.
    """
    way = np.broadcast_to(centre_b - centre_a, (len(radius_a), 2))
    apart = np.hypot(way[:, 0], way[:, 1])
    apart = np.where(apart > _NEAREST_CENTRES_M, apart, np.nan)
    unit = way / apart[:, None]
    outside = apart - radius_a - radius_b
    inside = np.abs(radius_a - radius_b) - apart
    with np.errstate(invalid='ignore'):
        along = (radius_a**2 - radius_b**2 + apart**2) / (2.0 * apart)
        half = np.sqrt(np.maximum(radius_a**2 - along**2, 0.0))
        # Side by side; b within a; a within b.
        middle = np.where(
            outside > 0.0,
            0.5 * (radius_a + apart - radius_b),
            0.5 * np.where(radius_a > radius_b, 1.0, -1.0) * (radius_a + radius_b) + 0.5 * apart,
        )
        missed = (outside > 0.0) | (inside > 0.0)
        along = along if chord else np.where(missed, middle, along)
        half = np.where(missed, 0.0, half)
        gap = np.maximum(np.maximum(outside, inside), 0.0)
    foot = centre_a + along[:, None] * unit
    across = half[:, None] * np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    return CirclePair(foot + across, foot - across, gap)


def touching(gap: Array, std_a: Array, std_b: Array) -> Array:
    """Return 1 where noise explains that two circles miss each other, NaN where it does not."""
    with np.errstate(invalid='ignore'):
        near = gap <= GAP_SIGMAS * np.hypot(std_a, std_b)
    return np.where(near, 1.0, np.nan)


def plane_of(ranges: Array, height: Array) -> Array:
    """Return slant ranges carried down by a height; 0 where they are too short for it [m]."""
    return np.asarray(np.sqrt(np.maximum(np.maximum(ranges, 0.0) ** 2 - height**2, 0.0)))


def meet(
    epochs: Epochs, ranges: Array, pairs: NDArray[np.int64], chord: bool = False
) -> tuple[Array, Array]:
    """Return both points where the circles of one pair of ranges per epoch meet.

    Parameters
    ----------
    epochs : Epochs
        For anchors and standard deviations.
    ranges : ndarray, shape (m, n)
        Slant ranges, which may be others than the epochs' [m].
    pairs : ndarray of int, shape (m, 2)
        Which two anchors.
    chord : bool
        As for `intersect`.

    Returns
    -------
    first, second : ndarray, shape (m, 2)
        As in `CirclePair`; NaN where the circles miss each other by more than noise explains.
    """
    rows = np.arange(len(ranges))
    a, b = pairs.T
    pair = intersect(
        epochs.anchors[a, :2],
        epochs.anchors[b, :2],
        plane_of(ranges[rows, a], epochs.height[a]),
        plane_of(ranges[rows, b], epochs.height[b]),
        chord,
    )
    near = touching(pair.gap, epochs.std[rows, a], epochs.std[rows, b])[:, None]
    return pair.first * near, pair.second * near


def blur(epochs: Epochs, ranges: Array, pairs: NDArray[np.int64]) -> Array:
    """Return the variance across the line of centres of circles that hardly meet.

    Half of the chord, h, is the root of h^2, whose standard deviation follows from those of the
    ranges. Where h^2 is not above that, moving the ranges says too little of h (nothing where the
    circles miss each other): the missing part of the variance is made up.

    Returns
    -------
    ndarray, shape (m, 2, 2)
        To add to the covariance of the intersection [m^2].
    """
    rows = np.arange(len(ranges))
    a, b = pairs.T
    way = epochs.anchors[b, :2] - epochs.anchors[a, :2]
    apart = np.maximum(np.hypot(way[:, 0], way[:, 1]), _NEAREST_CENTRES_M)
    slant_a, slant_b = ranges[rows, a], ranges[rows, b]
    radius2_a = plane_of(slant_a, epochs.height[a]) ** 2
    radius2_b = plane_of(slant_b, epochs.height[b]) ** 2
    share = (radius2_a - radius2_b + apart**2) / (2.0 * apart**2)
    chord2 = radius2_a - (share * apart) ** 2
    spread = np.hypot(
        2.0 * slant_a * (1.0 - share) * epochs.std[rows, a],
        2.0 * slant_b * share * epochs.std[rows, b],
    )
    across = np.stack([-way[:, 1], way[:, 0]], axis=1) / apart[:, None]
    missing = np.maximum(spread - np.maximum(chord2, 0.0), 0.0)
    return np.asarray(missing[:, None, None] * across[:, :, None] * across[:, None, :])
