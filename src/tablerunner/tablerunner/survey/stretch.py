"""A stretch of a drive: its knots, and the ranges as seen from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.survey.problem import TagRanges
from tablerunner.survey.record import RANGE_STD_M, RangeTable
from tablerunner.survey.track import Indices, Pieces, Track, relative, rotated


@dataclass(frozen=True)
class Stretch:
    """A stretch from the start of a drive.

    Attributes
    ----------
    pieces : Pieces
    rows : ndarray of int, shape (k,)
        Of the track, of each knot.
    ranges : TagRanges
    """

    pieces: Pieces
    rows: Indices
    ranges: TagRanges


def seen_from_knots(
    track: Track, knots: Indices, table: RangeTable, tag: tuple[float, float, float]
) -> TagRanges:
    """Return ranges with their tag as seen from the nearest of the knots (rows of the track)."""
    knot = Pieces.of(track, knots).nearest(table.stamps)
    seen = relative(track.at(table.stamps), track.poses[knots[knot]])
    flat = seen[:, :2] + rotated(np.broadcast_to(tag[:2], (len(seen), 2)), seen[:, 2])
    lever = np.column_stack([flat, np.full(len(flat), tag[2])])
    return TagRanges(knot, table.anchor, lever, table.range_m, np.full(len(flat), RANGE_STD_M))


def width(track: Track) -> float:
    """Return how wide the way is, across its longest direction [m]."""
    places = track.poses[:, :2] - track.poses[:, :2].mean(axis=0)
    across = np.linalg.svd(places, full_matrices=False)[2][1]
    return float(np.ptp(places @ across))
