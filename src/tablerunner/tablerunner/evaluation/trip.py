"""A trip as the picture of it and the table of its errors need it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tablerunner.evaluation.consistency import (
    SourceSummary,
    consistency,
    nees,
    summarize_innovations,
)
from tablerunner.evaluation.errors import ErrorSeries, ErrorSummary, compare
from tablerunner.evaluation.truth import Stamps, Truth
from tablerunner.types import Anchor, Innovation, LosState, Matrix, RangeSample, seconds


@dataclass(frozen=True, slots=True)
class Halt:
    """A time at which the robot wanted to drive and the safety stop held it."""

    stamp: int  # [ns] when it began
    duration_s: float
    x: float  # [m] in map
    y: float
    person: tuple[float, float] | None = None  # [m] where somebody stood near; None: nobody did
    emergency: bool = False  # by an emergency stop


def _no_stamps() -> Stamps:
    return np.empty(0, dtype=np.int64)


def _no_poses() -> Matrix:
    return np.empty((0, 3))


def _no_positions() -> Matrix:
    return np.empty((0, 2))


@dataclass(frozen=True)
class Trip:
    """What happened on the way, in map.

    Attributes
    ----------
    title : str
        For people.
    estimator : str
        Name of the estimator.
    stamps : ndarray of int64, shape (n,)
        Times of the estimates [ns].
    poses : ndarray, shape (n, 3)
        Estimated x, y [m], heading [rad] of base_link.
    covariances : ndarray, shape (n, 3, 3)
        Of the poses.
    truth : Truth
        True poses; may be empty.
    fixes : ndarray, shape (m, 2)
        UWB-only positions of the tag [m].
    fix_stamps : ndarray of int64, shape (m,)
        Their times [ns].
    ranges : tuple of RangeSample
        With the driver's judgement of the line of sight.
    anchors : tuple of Anchor
        Where the ranges were measured to.
    innovations : tuple of Innovation
        What each measurement did.
    halts : tuple of Halt
        Where the safety stop held the robot, for people or things.
    """

    title: str
    estimator: str
    stamps: Stamps
    poses: Matrix
    covariances: Matrix
    truth: Truth = field(default_factory=lambda: Truth(_no_stamps(), _no_positions(), np.empty(0)))
    fixes: Matrix = field(default_factory=_no_positions)
    fix_stamps: Stamps = field(default_factory=_no_stamps)
    ranges: tuple[RangeSample, ...] = ()
    anchors: tuple[Anchor, ...] = ()
    innovations: tuple[Innovation, ...] = ()
    halts: tuple[Halt, ...] = ()

    @property
    def start(self) -> int:
        """Earliest time of estimates and truth [ns]; 0 when there are none."""
        firsts = [int(stamps[0]) for stamps in (self.stamps, self.truth.stamps) if len(stamps)]
        return min(firsts, default=0)

    @property
    def end(self) -> int:
        """Latest time of estimates and truth [ns]; 0 when there are none."""
        lasts = [int(stamps[-1]) for stamps in (self.stamps, self.truth.stamps) if len(stamps)]
        return max(lasts, default=0)

    def errors(self) -> ErrorSeries:
        """Return the errors of the estimates at all times that have a truth."""
        return compare(self.stamps, self.poses, self.truth, self.covariances)

    def nlos(self) -> tuple[RangeSample, ...]:
        """Return the ranges that were judged to be without line of sight."""
        return tuple(item for item in self.ranges if item.los is LosState.NLOS)

    def places(self, stamps: Iterable[int]) -> Matrix:
        """Return where the robot was at some times: the truth, else the nearest estimate.

        Returns
        -------
        ndarray, shape (n, 2)
            NaN where neither is known.
        """
        wanted = np.fromiter(stamps, dtype=np.int64)
        positions, _ = self.truth.at(wanted)
        missing = np.isnan(positions[:, 0])
        if missing.any() and len(self.stamps):
            rows = np.searchsorted(self.stamps, wanted[missing]).clip(0, len(self.stamps) - 1)
            positions[missing] = self.poses[rows, :2]
        return positions


def errors_table(trip: Trip) -> dict[str, Any]:
    """Return what errors.json holds: plain values, lengths in m, angles in rad, times in s."""
    errors = trip.errors()
    fixes = compare(
        trip.fix_stamps,
        np.column_stack([trip.fixes, np.zeros(len(trip.fixes))]),
        trip.truth,
    )
    sources = summarize_innovations(trip.innovations)
    return {
        'title': trip.title,
        'estimator': trip.estimator,
        'duration': seconds(trip.end - trip.start),
        'position_error': _sizes(errors.summary()),
        'uwb_only_error': _sizes(fixes.summary()),
        'heading_rmse': errors.summary().heading_rmse,
        'nees': _nees(errors),
        'sources': {name: _source(item) for name, item in sources.items()},
        'ranges': len(trip.ranges),
        'nlos_ranges': len(trip.nlos()),
        'halts': [
            {
                'after': seconds(item.stamp - trip.start),
                'duration': item.duration_s,
                'x': item.x,
                'y': item.y,
                'for_a_person': item.person is not None,
                'emergency': item.emergency,
            }
            for item in trip.halts
        ],
    }


def _sizes(summary: ErrorSummary) -> dict[str, Any]:
    return {
        'compared': summary.count,
        'rmse': summary.rmse,
        'mean': summary.mean,
        'max': summary.max,
        'final': summary.final,
    }


def _nees(errors: ErrorSeries) -> dict[str, Any]:
    """Return the mean NEES of x, y and, where the truth has it, heading.

    Errors that follow each other closely are not independent: the bounds, which take them to be,
    are narrower than they should be.
    """
    size = 3 if len(errors.stamps) and np.isfinite(errors.errors[:, 2]).all() else 2
    values = nees(errors.errors[:, :size], errors.covariances[:, :size, :size])
    judged = consistency(values.tolist(), [size] * len(values))
    return {'dimensions': size, 'mean': judged.mean, 'low': judged.low, 'high': judged.high}


def _source(item: SourceSummary) -> dict[str, Any]:
    return {
        'measurements': item.count,
        'accepted': item.accepted,
        'nis': item.nis.mean,
        'nis_low': item.nis.low,
        'nis_high': item.nis.high,
    }
