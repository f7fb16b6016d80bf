"""The way of the robot by dead reckoning, cut into pieces between knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import NANOSECONDS, OdometrySample

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Indices = NDArray[np.intp]

KNOT_WAY_M = 0.5
KNOT_TURN_RAD = 0.5
MOST_KNOTS = 400
"""Longer drives get longer pieces: what they then lack in detail, their length makes up for."""


@dataclass(frozen=True)
class Track:
    """Poses of base_link in odom.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Strictly increasing [ns].
    poses : ndarray, shape (n, 3)
        x, y [m], heading (not wrapped) [rad].
    """

    stamps: Stamps
    poses: Array

    @classmethod
    def of(cls, samples: Sequence[OdometrySample]) -> Track:
        """Return the track of odometry; samples that do not advance in time are left out."""
        kept: list[OdometrySample] = []
        for sample in samples:
            if not kept or sample.stamp > kept[-1].stamp:
                kept.append(sample)
        poses = np.array([(s.pose.x, s.pose.y, s.pose.heading) for s in kept]).reshape(-1, 3)
        poses[:, 2] = np.unwrap(poses[:, 2])
        return cls(np.array([s.stamp for s in kept], dtype=np.int64), poses)

    @property
    def way(self) -> Array:
        """Way driven since the start, backwards too, shape (n,) [m]."""
        steps = np.linalg.norm(np.diff(self.poses[:, :2], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def turned(self) -> Array:
        """Angles turned since the start, either way, shape (n,) [rad]."""
        return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.poses[:, 2])))])

    def at(self, stamps: Stamps) -> Array:
        """Return the poses at times within the track, linear in between, shape (m, 3)."""
        # Differences first: nanoseconds of today do not fit into a double.
        times = (stamps - self.stamps[0]) / NANOSECONDS
        known = (self.stamps - self.stamps[0]) / NANOSECONDS
        return np.column_stack([np.interp(times, known, self.poses[:, i]) for i in range(3)])

    def cut(self, end: int) -> Track:
        """Return the first `end` poses."""
        return Track(self.stamps[:end], self.poses[:end])


def choose_knots(track: Track) -> Indices:
    """Return the rows of a track that become knots: first, last, and evenly in between.

    A piece is at most `KNOT_WAY_M` long or `KNOT_TURN_RAD` of turning, or in part both; more where
    there would be more than `MOST_KNOTS`.
    """
    progress = track.way / KNOT_WAY_M + track.turned / KNOT_TURN_RAD
    stretch = max(1.0, float(progress[-1]) / MOST_KNOTS)
    new = np.flatnonzero(np.diff(np.floor(progress / stretch))) + 1
    return np.unique(np.concatenate([[0], new, [len(progress) - 1]]))


def rotated(vectors: Array, angles: Array) -> Array:
    """Return vectors, shape (n, 2), turned by angles, shape (n,), counter-clockwise."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.column_stack([cos * x - sin * y, sin * x + cos * y])


def laid_on(here: Array, there: Array) -> tuple[Array, tuple[Array, Array, float]]:
    """Return points moved and turned, not stretched, onto others, shapes (n, 2).

    Besides, how: what is taken off first, what is added in the end, and the turn [rad].
    """
    one, two = here.mean(axis=0), there.mean(axis=0)
    a, b = here - one, there - two
    angle = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    return rotated(a, np.full(len(a), angle)) + two, (one, two, angle)


def relative(poses: Array, origins: Array) -> Array:
    """Return poses as seen from others, row by row: shapes (n, 3)."""
    apart = rotated(poses[:, :2] - origins[:, :2], -origins[:, 2])
    return np.column_stack([apart, poses[:, 2] - origins[:, 2]])


def composed(origins: Array, poses: Array) -> Array:
    """Return poses that are seen from `origins` in the frame of those: shapes (n, 3)."""
    moved = rotated(poses[:, :2], origins[:, 2])
    return np.column_stack([origins[:, :2] + moved, origins[:, 2] + poses[:, 2]])


@dataclass(frozen=True)
class Pieces:
    """A track as knots and the motions between them.

    Attributes
    ----------
    stamps : ndarray of int64, shape (k,)
        Of the knots.
    motions : ndarray, shape (k - 1, 3)
        Of each knot seen from the one before: x, y [m], turn [rad].
    way, turned, time : ndarray, shape (k - 1,)
        How far was driven and turned, either way, and how long it took [m, rad, s].
    """

    stamps: Stamps
    motions: Array
    way: Array
    turned: Array
    time: Array

    @classmethod
    def of(cls, track: Track, knots: Indices) -> Pieces:
        """Return the pieces of a track between some of its rows."""
        chosen = track.poses[knots]
        return cls(
            track.stamps[knots],
            relative(chosen[1:], chosen[:-1]),
            np.diff(track.way[knots]),
            np.diff(track.turned[knots]),
            np.diff(track.stamps[knots]) / NANOSECONDS,
        )

    @property
    def count(self) -> int:
        """Number of knots."""
        return len(self.stamps)

    def nearest(self, stamps: Stamps) -> Indices:
        """Return which knot is nearest in time, shape (m,)."""
        if self.count == 1:
            return np.zeros(len(stamps), dtype=np.intp)
        after = np.clip(np.searchsorted(self.stamps, stamps), 1, self.count - 1)
        nearer = stamps - self.stamps[after - 1] <= self.stamps[after] - stamps
        return np.asarray(after - nearer, dtype=np.intp)

    def whiteners(self, noise: tuple[float, float, float, float]) -> tuple[Array, Array, Array]:
        """Return what makes the errors of the motions independent and of size one.

        Along the chord and across it; the error across grows out of that of the heading: with
        turn variance v over a chord d, var(across) = v d^2 / 3, cov(across, turn) = v d / 2.

        Parameters
        ----------
        noise : tuple
            As of `MotionNoise`: distance [m/sqrt(m)], heading per turn, per distance, per time.

        Returns
        -------
        along, turn, across : ndarray, shape (k - 1, 3)
            Times x, y, turn of an error in the frame of the first knot; across what the turn
            explains.
        """
        distance, per_turn, per_way, per_time = noise
        chord = np.linalg.norm(self.motions[:, :2], axis=1)
        along_std = np.sqrt(distance**2 * self.way + FLOOR_M**2)
        variance = per_turn**2 * self.turned + per_way**2 * self.way + per_time**2 * self.time
        variance += FLOOR_RAD**2
        course = np.where(
            chord > FLOOR_M,
            np.arctan2(self.motions[:, 1], self.motions[:, 0]),
            0.5 * self.motions[:, 2],
        )
        cos, sin = np.cos(course), np.sin(course)
        zero = np.zeros_like(cos)
        along = np.stack([cos, sin, zero], axis=1) / along_std[:, None]
        across = np.stack([-sin, cos, zero], axis=1)
        spin = np.stack([zero, zero, zero + 1.0], axis=1)
        turn_std = np.sqrt(variance)
        # Across, given the turn: half the chord of it, and what is left.
        left = np.sqrt(variance * chord**2 / 12.0 + FLOOR_M**2)
        across = (across - 0.5 * chord[:, None] * spin) / left[:, None]
        return along, spin / turn_std[:, None], across


FLOOR_M = 0.001
"""Nothing is known better than this of a piece: the encoders have ticks."""

FLOOR_RAD = 0.0005
