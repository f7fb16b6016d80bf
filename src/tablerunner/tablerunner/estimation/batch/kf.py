"""Sun's Kalman filter on positions over arrays: `Kf` with `FixMaker` for many runs in one go.

Its heading is odometry's and never corrected, so that between two corrections every run moves by
what odometry says, turned into the map. Therefore only the place and variance after the last fix
are kept; a fix is of the instant at which its round of ranges began, a little in the past, and
everything after it follows from odometry.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.kf import weigh
from tablerunner.estimation.models.range_model import Point3
from tablerunner.odometry.batch import BatchTrack
from tablerunner.types import Anchor
from tablerunner.uwb import PositionerConfig
from tablerunner.uwb.batch import BatchRanges, EpochGatherer, Finished, positions

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class _Instant(NamedTuple):
    """A time of each run: as a share of the step of odometry after a stamp; shapes (runs,)."""

    step: Index
    share: Array

    def some(self, runs: Index) -> _Instant:
        return _Instant(self.step[runs], self.share[runs])


def follow_kf(
    config: EstimatorConfig,
    positioner: PositionerConfig,
    anchors: tuple[Anchor, ...],
    lever_arm: Point3,
    track: BatchTrack,
    ranges: BatchRanges,
    start: Start,
) -> Iterator[tuple[int, Array]]:
    """Yield the index of each stamp of the odometry after the first, and the places, (runs, 2).

    What the localiser believes with ``estimator: kf`` when that odometry comes.

    Parameters
    ----------
    config : EstimatorConfig
    positioner : PositionerConfig
        How ranges become positions.
    anchors : tuple of Anchor
    lever_arm : tuple
        Tag in base_link [m].
    track : BatchTrack
    ranges : BatchRanges
    start : Start
        At the first stamp of the odometry, the same for all runs.
    """
    follower = _Follower(config, positioner, anchors, lever_arm, track, ranges, start)
    number = int(np.searchsorted(ranges.stamps, track.stamps[0], side='right'))
    for index in range(1, len(track.stamps)):
        while number < len(ranges.stamps) and ranges.stamps[number] < track.stamps[index]:
            follower.add(number, index - 1)
            number += 1
        yield index, follower.places(index)


class _Follower:
    """The state of all runs: place and variance at the last fix, and ranges of the round."""

    def __init__(
        self,
        config: EstimatorConfig,
        positioner: PositionerConfig,
        anchors: tuple[Anchor, ...],
        lever_arm: Point3,
        track: BatchTrack,
        ranges: BatchRanges,
        start: Start,
    ) -> None:
        runs = track.heading.shape[1]
        self._config, self._anchors, self._lever = config, anchors, lever_arm
        self._positioner = positioner.replace(tag_height=lever_arm[2])
        self._track, self._ranges = track, ranges
        self._runs = np.arange(runs)
        self._turned = float(start.pose[2])  # of odom in map
        self._step = np.diff(track.length, axis=0)
        self._turn = np.diff(track.heading, axis=0)
        zero = np.zeros_like(self._step[:1])
        self._squares = np.concatenate([zero, np.cumsum(self._step**2, axis=0)])
        self._gatherer = EpochGatherer(self._positioner, len(anchors), runs, ranges.stamps)
        self._began = _Instant(np.zeros(runs, dtype=np.int64), np.zeros(runs))
        self._last = _Instant(np.zeros(runs, dtype=np.int64), np.zeros(runs))
        self._place = np.tile(start.pose[:2], (runs, 1))
        self._variance = np.tile(np.diagonal(start.pose_covariance)[:2], (runs, 1))

    def places(self, index: int) -> Array:
        """Return where base_link is believed to be at a stamp after the last fix, (runs, 2)."""
        since = self._track.place[index].T - self._origin(self._last, self._runs)
        return self._place + self._to_map(since)

    def add(self, number: int, newest: int) -> None:
        """Take the ranges of an exchange; `newest` is the odometry that has come before it."""
        ranges, track = self._ranges, self._track
        anchor, measured = int(ranges.anchor[number]), ranges.range_m[number]
        length = track.stamps[newest + 1] - track.stamps[newest]
        share = float(ranges.stamps[number] - track.stamps[newest]) / float(length)
        fresh = self._gatherer.begins(number, anchor)
        now = _Instant(np.full(len(self._runs), newest), np.full(len(self._runs), share))
        began = _Instant(
            np.where(fresh, now.step, self._began.step),
            np.where(fresh, now.share, self._began.share),
        )
        carried = self._distance(began, newest, anchor) - self._distance(now, newest, anchor)
        carried = np.maximum(measured + np.where(fresh, 0.0, carried), 0.0)
        for ended in self._gatherer.add(number, anchor, carried, ranges.nlos_probability[number]):
            # A round that this range ended began before; one that it completed may begin with it.
            whole = self._began if ended.early else began
            self._correct(ended, whole.some(ended.runs))
        arrived = np.isfinite(measured)
        self._began = _Instant(
            np.where(arrived, began.step, self._began.step),
            np.where(arrived, began.share, self._began.share),
        )

    def _correct(self, ended: Finished, instant: _Instant) -> None:
        """Let the fixes of some runs correct their places."""
        place, solved = positions(self._positioner, self._anchors, ended, self._ranges.variance_m2)
        runs = ended.runs[solved]
        instant = _Instant(instant.step[solved], instant.share[solved])
        last = self._last.some(runs)
        moved, way2 = self._moved(last, instant, runs)
        before = self._place[runs] + self._to_map(moved)
        grown = self._variance[runs] + self._config.sun.process_variance * way2[:, None]
        heading = self._turned + self._heading(instant, runs)
        tag = before + _rotated(np.array(self._lever[:2]), heading)
        weighed = weigh(self._config.sun, grown, place[solved] - tag)
        self._place[runs] = before + weighed.moved
        self._variance[runs] = weighed.variance
        self._last.step[runs] = instant.step
        self._last.share[runs] = instant.share

    def _moved(self, begin: _Instant, end: _Instant, runs: Index) -> tuple[Array, Array]:
        """Return the ways between instants in odom, (m, 2), and their squares step by step, (m,).

        The squares are what the filter's noise grows with: one for each prediction.
        """
        first, last = self._step[begin.step, runs], self._step[end.step, runs]
        within = begin.step == end.step
        part = np.where(within, end.share - begin.share, end.share)
        since = np.where(within, begin.share, 0.0)
        turn = self._turn[end.step, runs]
        course = self._track.heading[end.step, runs] + turn * (since + 0.5 * part)
        chord = _direction(course) * (part * last)[:, None]
        whole = self._track.place[end.step, :, runs] - self._origin(begin, runs)
        steps = self._squares[end.step, runs] - self._squares[begin.step + 1, runs]
        steps = steps + ((1.0 - begin.share) * first) ** 2
        way = np.where(within[:, None], 0.0, whole) + chord
        return way, np.where(within, 0.0, steps) + (part * last) ** 2

    def _origin(self, instant: _Instant, runs: Index) -> Array:
        """Return from where straight to the end of its step each run went on, (m, 2), in odom."""
        left = 1.0 - instant.share
        turn = self._turn[instant.step, runs]
        course = self._track.heading[instant.step, runs] + turn * (instant.share + 0.5 * left)
        chord = _direction(course) * (left * self._step[instant.step, runs])[:, None]
        return np.asarray(self._track.place[instant.step + 1, :, runs] - chord)

    def _heading(self, instant: _Instant, runs: Index) -> Array:
        turn = self._turn[instant.step, runs]
        return np.asarray(self._track.heading[instant.step, runs] + instant.share * turn)

    def _distance(self, instant: _Instant, newest: int, anchor: int) -> Array:
        """Return how far the tag is believed to be from an anchor at instants, (runs,) [m].

        By the odometry up to `newest`, beyond it by the velocity that it had.
        """
        runs, track = self._runs, self._track
        ahead = instant.step == newest
        step = np.where(ahead, newest - 1, instant.step)
        ratio = self._ratio(newest) if newest > 0 else 0.0
        share = np.where(ahead, instant.share * ratio, instant.share)
        step = np.maximum(step, 0)
        turn = share * self._turn[step, runs]
        course = track.heading[instant.step, runs] + 0.5 * turn
        way = _direction(course) * (share * self._step[step, runs])[:, None]
        odom = track.place[instant.step, :, runs] + way
        base = self._place + self._to_map(odom - self._origin(self._last, runs))
        heading = self._turned + track.heading[instant.step, runs] + turn
        tag = base + _rotated(np.array(self._lever[:2]), heading)
        place = self._anchors[anchor].position
        return np.sqrt(
            (tag[:, 0] - place[0]) ** 2
            + (tag[:, 1] - place[1]) ** 2
            + (self._lever[2] - place[2]) ** 2
        )

    def _ratio(self, newest: int) -> float:
        """Return how long the step after a stamp lasts, over how long the one before did."""
        before, here, after = self._track.stamps[newest - 1 : newest + 2]
        return float(after - here) / float(here - before)

    def _to_map(self, vector: Array) -> Array:
        return _rotated(vector.T, self._turned)


def _rotated(vector: Array, angle: Array | float) -> Array:
    """Return vectors, shape (2,) or (2, m), turned by an angle, shape (m, 2)."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack(
        [cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]], axis=-1
    )


def _direction(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
