"""Filters of many runs along odometry and ranges, in the order in which things were measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.batch.estimate import BatchEstimate, BatchInnovation
from tablerunner.estimation.estimator import Start
from tablerunner.odometry.batch import BatchTrack, Motions
from tablerunner.uwb.batch import BatchRanges

Array = NDArray[np.float64]


class BatchFilter(Protocol):
    """A filter of many runs on odometry and ranges."""

    def start(self, start: Start, runs: int) -> BatchEstimate:
        """Return the first estimate of every run."""
        ...

    def predict(self, estimate: BatchEstimate, motions: Motions) -> BatchEstimate:
        """Return the estimates carried on by their motions."""
        ...

    def update_range(
        self,
        estimate: BatchEstimate,
        anchor: int,
        range_m: Array,
        variance_m2: float,
        nlos_probability: Array,
    ) -> tuple[BatchEstimate, BatchInnovation]:
        """Return the estimates corrected by a range each."""
        ...


def follow(
    batch: BatchFilter, track: BatchTrack, ranges: BatchRanges, start: Start
) -> Iterator[tuple[int, BatchEstimate]]:
    """Yield the index of each stamp of the odometry after the first, and what is believed there.

    As `Localizer` has it when that odometry comes: a range of the same stamp comes after it.
    Nothing is kept; the caller keeps what it needs.

    Parameters
    ----------
    batch : BatchFilter
    track : BatchTrack
    ranges : BatchRanges
    start : Start
        At the first stamp of the odometry, the same for all runs.
    """
    runs = track.heading.shape[1]
    estimate = batch.start(start, runs)
    bounds = np.searchsorted(ranges.stamps, track.stamps, side='left')
    # A range of the very stamp of the start lies before all that is estimated.
    exchange = int(np.searchsorted(ranges.stamps, track.stamps[0], side='right'))
    for index in range(1, len(track.stamps)):
        before, after = int(track.stamps[index - 1]), int(track.stamps[index])
        reached, whole = np.zeros(runs), np.ones(runs)
        for number in range(exchange, int(bounds[index])):
            range_m = ranges.range_m[number]
            # Who has no range does not stop here: a step in two parts is not quite the same step.
            share = (int(ranges.stamps[number]) - before) / (after - before)
            stop = np.where(np.isfinite(range_m), share, reached)
            estimate = batch.predict(estimate, track.motions(index, reached, stop))
            reached = stop
            estimate, _ = batch.update_range(
                estimate,
                int(ranges.anchor[number]),
                range_m,
                ranges.variance_m2,
                ranges.nlos_probability[number],
            )
        exchange = max(exchange, int(bounds[index]))
        estimate = batch.predict(estimate, track.motions(index, reached, whole))
        yield index, estimate
