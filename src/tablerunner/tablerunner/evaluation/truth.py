"""The true path, interpolated to any time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.pose import Pose2
from tablerunner.types import Matrix, Vector, nanoseconds

Stamps = NDArray[np.int64]

LONGEST_GAP_S = 0.5
"""Gaps of the truth longer than this are not interpolated over."""


@dataclass(frozen=True)
class Truth:
    """True poses of base_link in map.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Strictly increasing [ns].
    positions : ndarray, shape (n, 2)
        x, y [m].
    headings : ndarray, shape (n,)
        Continuous (not wrapped) [rad]; NaN where the source does not know it.
    """

    stamps: Stamps
    positions: Matrix
    headings: Vector

    @classmethod
    def from_poses(cls, poses: Iterable[tuple[int, Pose2, bool]]) -> Truth:
        """Make it of (stamp, pose, whether the heading is known).

        They are sorted by stamp; of equal stamps the last counts.
        """
        by_stamp = {stamp: (pose, known) for stamp, pose, known in poses}
        stamps = np.array(sorted(by_stamp), dtype=np.int64)
        chosen = [by_stamp[int(stamp)] for stamp in stamps]
        positions = np.array([(pose.x, pose.y) for pose, _ in chosen]).reshape(-1, 2)
        headings = np.array([pose.heading if known else np.nan for pose, known in chosen])
        finite = np.isfinite(headings)
        headings[finite] = np.unwrap(headings[finite])
        return cls(stamps, positions, headings)

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.stamps)

    def at(self, stamps: Stamps, longest_gap_s: float = LONGEST_GAP_S) -> tuple[Matrix, Vector]:
        """Return position and heading at other times, linear between neighbours.

        Parameters
        ----------
        stamps : ndarray of int64, shape (m,)
            Times [ns].
        longest_gap_s : float
            Times inside a longer gap have no truth [s].

        Returns
        -------
        positions : ndarray, shape (m, 2)
            NaN where there is no truth: before the first pose, after the last, inside a gap.
        headings : ndarray, shape (m,)
            Not wrapped [rad]; NaN also where the heading is unknown.
        """
        stamps = np.asarray(stamps, dtype=np.int64)
        positions = np.full((len(stamps), 2), np.nan)
        headings = np.full(len(stamps), np.nan)
        if not len(self.stamps):
            return positions, headings
        right = np.clip(np.searchsorted(self.stamps, stamps), 1, max(len(self.stamps) - 1, 1))
        left = right - 1
        right = np.minimum(right, len(self.stamps) - 1)
        # Differences first: nanoseconds of today do not fit into a double.
        span = (self.stamps[right] - self.stamps[left]).astype(float)
        ahead = (stamps - self.stamps[left]).astype(float)
        share = np.divide(ahead, span, out=np.zeros_like(ahead), where=span > 0.0)
        on_pose = (stamps == self.stamps[left]) | (stamps == self.stamps[right])
        good = on_pose | (span <= nanoseconds(longest_gap_s))
        good &= (stamps >= self.stamps[0]) & (stamps <= self.stamps[-1])
        step = self.positions[right] - self.positions[left]
        positions[good] = (self.positions[left] + share[:, None] * step)[good]
        turn = self.headings[right] - self.headings[left]
        headings[good] = (self.headings[left] + share * turn)[good]
        return positions, headings
