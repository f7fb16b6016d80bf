"""Ranges and UWB-only fixes of many robots at once: `Ranger` and `Positioner` over arrays.

All runs share their stamps; arrays have time first and runs last. For recorded or simulated data
that is known to be clean: a range that cannot be is taken for lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError
from tablerunner.types import Anchor, nanoseconds
from tablerunner.uwb import ranging
from tablerunner.uwb.nlos.signal_quality import judge_signal
from tablerunner.uwb.positioner import UNKNOWN_STD_M, PositionerConfig
from tablerunner.uwb.ranger import RangerConfig
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.registry import solve

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class BatchRanges:
    """Calibrated ranges of many robots.

    Attributes
    ----------
    stamps : ndarray of int64, shape (e,)
    anchor : ndarray of int64, shape (e,)
        Index of the anchor.
    range_m : ndarray, shape (e, runs)
        NaN where there is none.
    nlos_probability : ndarray, shape (e, runs)
    variance_m2 : float
    """

    stamps: Stamps
    anchor: Stamps
    range_m: Array
    nlos_probability: Array
    variance_m2: float


def ranges_of(
    config: RangerConfig, stamps: Stamps, anchor: Stamps, flight_s: Array, gap_db: Array
) -> BatchRanges:
    """Return calibrated ranges with their NLOS probabilities.

    Parameters
    ----------
    config : RangerConfig
        Its `nlos_test` must be ``signal_quality`` or ``none``.
    stamps, anchor : ndarray of int64, shape (e,)
    flight_s : ndarray, shape (e, runs)
        Times of flight by double-sided ranging; NaN where an exchange was lost.
    gap_db : ndarray, shape (e, runs)
        Receive power minus first-path power.

    Raises
    ------
    ConfigError
        Another test.
    """
    if config.nlos_test not in ('signal_quality', 'none'):
        raise ConfigError('nlos_test', config.nlos_test, 'signal_quality or none, for many robots')
    count = len(config.anchor_ids)
    bias = np.array(config.anchor_biases or (0.0,) * count)[anchor][:, None]
    scale = np.array(config.anchor_scales or (0.0,) * count)[anchor][:, None]
    range_m = ranging.calibrated(ranging.distance(flight_s), bias, scale)
    probability = np.full_like(range_m, np.nan)
    if config.nlos_test == 'signal_quality':
        probability = judge_signal(
            gap_db, np.zeros_like(gap_db), config.nlos_gap_centre, config.nlos_gap_width
        ).probability
    with np.errstate(invalid='ignore'):
        usable = (range_m > 0.0) & (range_m <= config.max_range)
        shorter = ranging.nlos_corrected(range_m, probability > 0.5, config.nlos_offset)
        range_m = np.where(shorter > 0.0, shorter, range_m)
    return BatchRanges(
        stamps, anchor, np.where(usable, range_m, np.nan), probability, config.range_std**2
    )


@dataclass(frozen=True)
class Finished:
    """Epochs that ended with an exchange.

    Attributes
    ----------
    runs : ndarray of int64, shape (m,)
        Which runs.
    ranges, nlos : ndarray, shape (m, anchors)
        NaN where an anchor did not answer.
    mean_stamp : ndarray of int64, shape (m,)
        [ns].
    early : bool
        Whether a range ended them that is not theirs: it came late, or twice.
    """

    runs: Stamps
    ranges: Array
    nlos: Array
    mean_stamp: Stamps
    early: bool


class EpochGatherer:
    """Gathers each run's ranges until every anchor has answered, one answers again, or time is up.

    Parameters
    ----------
    config : PositionerConfig
    anchors, runs : int
    stamps : ndarray of int64, shape (e,)
        Of all exchanges.
    """

    def __init__(self, config: PositionerConfig, anchors: int, runs: int, stamps: Stamps) -> None:
        self._longest = nanoseconds(config.epoch)
        self._all = stamps
        self._ranges = np.full((runs, anchors), np.nan)
        self._nlos = np.full((runs, anchors), np.nan)
        self._has = np.zeros((runs, anchors), dtype=bool)
        self._count = np.zeros(runs, dtype=np.int64)
        self._first = np.zeros(runs, dtype=np.int64)
        self._offsets = np.zeros(runs, dtype=np.int64)  # sum of stamps since the first

    def begins(self, index: int, anchor: int) -> Flags:
        """Return whose epoch an exchange with an anchor would begin, shape (runs,)."""
        late = self._all[index] - self._all[self._first] > self._longest
        return np.asarray((self._count == 0) | late | self._has[:, anchor])

    def add(self, index: int, anchor: int, range_m: Array, nlos: Array) -> list[Finished]:
        """Take the ranges of one exchange, NaN where lost; return the epochs that it ends.

        Epochs of fewer than three ranges are dropped.
        """
        arrived = np.isfinite(range_m)
        over = arrived & (self._count > 0) & self.begins(index, anchor)
        finished = [self._finish(over, early=True)] if over.any() else []
        begins = arrived & (self._count == 0)
        self._first[begins] = index
        self._ranges[arrived, anchor] = range_m[arrived]
        self._nlos[arrived, anchor] = nlos[arrived]
        self._has[arrived, anchor] = True
        self._count += arrived
        since = self._all[index] - self._all[self._first]
        self._offsets += np.where(arrived, since, 0)
        complete = arrived & (self._count == self._has.shape[1])
        if complete.any():
            finished.append(self._finish(complete, early=False))
        return [some for some in finished if len(some.runs)]

    def _finish(self, over: Flags, early: bool) -> Finished:
        runs = np.nonzero(over & (self._count >= MINIMUM_RANGES))[0]
        mean = self._all[self._first[runs]] + self._offsets[runs] // self._count[runs]
        finished = Finished(runs, self._ranges[runs], self._nlos[runs], mean, early)
        self._ranges[over] = np.nan
        self._nlos[over] = np.nan
        self._has[over] = False
        self._count[over] = 0
        self._offsets[over] = 0
        return finished


def positions(
    config: PositionerConfig, anchors: tuple[Anchor, ...], epochs: Finished, variance_m2: float
) -> tuple[Array, Flags]:
    """Return where the tag was in each epoch, (m, 2) [m], and which have an answer, (m,)."""
    places = np.array([anchor.position for anchor in anchors])
    bias = np.array([anchor.bias_m for anchor in anchors])
    known = np.where(np.isnan(epochs.nlos), 0.0, epochs.nlos)
    std = np.hypot(
        variance_m2**0.5 if variance_m2 > 0.0 else UNKNOWN_STD_M, known * config.nlos_std
    )
    fix = solve(config.solver, places, epochs.ranges - bias, std, config.tag_height, epochs.nlos)
    return fix.position, fix.solved


@dataclass(frozen=True)
class BatchFixes:
    """UWB-only fixes of many robots, one after the other.

    Attributes
    ----------
    runs : ndarray of int64, shape (m,)
    stamps : ndarray of int64, shape (m,)
        Mean stamps of the ranges.
    place : ndarray, shape (m, 2)
        Tag in map [m].
    """

    runs: Stamps
    stamps: Stamps
    place: Array


def fixes_of(
    config: PositionerConfig, anchors: tuple[Anchor, ...], ranges: BatchRanges, end: Stamps
) -> BatchFixes:
    """Return all fixes of all runs.

    Parameters
    ----------
    config : PositionerConfig
        Its `residual_test` is for single robots.
    anchors : tuple of Anchor
    ranges : BatchRanges
    end : ndarray of int64, shape (runs,)
        Each run has ended then [ns]; an epoch that is not complete by then is none.

    Raises
    ------
    ConfigError
        `residual_test` is set.
    """
    if config.residual_test:
        raise ConfigError('residual_test', True, 'false, for many robots')
    gatherer = EpochGatherer(config, len(anchors), len(end), ranges.stamps)
    found: list[Finished] = []
    for index, stamp in enumerate(ranges.stamps):
        anchor = int(ranges.anchor[index])
        measured = np.where(stamp <= end, ranges.range_m[index], np.nan)
        found += gatherer.add(index, anchor, measured, ranges.nlos_probability[index])
    epochs = Finished(
        np.concatenate([some.runs for some in found]),
        np.concatenate([some.ranges for some in found]),
        np.concatenate([some.nlos for some in found]),
        np.concatenate([some.mean_stamp for some in found]),
        early=False,
    )
    place, solved = positions(config, anchors, epochs, ranges.variance_m2)
    return BatchFixes(epochs.runs[solved], epochs.mean_stamp[solved], place[solved])
