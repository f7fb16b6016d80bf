"""What speaks against the pose that is believed: the innovations of the last while."""

from __future__ import annotations

from collections import deque

from tablerunner.estimation.ekf import SHORT
from tablerunner.estimation.estimator import RANGE_SOURCE
from tablerunner.types import Innovation

_PAUSE_NS = 1_500_000_000
"""A doubt that comes back within this time has never ended."""

_FEWEST = 12
"""Innovations that a mean is made of, at least."""


class Evidence:
    """Running mean of normalised innovations squared, by what they say of the pose.

    Whatever blocks the way to an anchor makes a range longer, never shorter. So a range that is
    too short speaks against the pose with all its weight, one that is too long no more than an
    ordinary one: a robot among people does not take itself for lost. Where the robot has been
    carried, some anchors are nearer than they were thought to be.

    Attributes
    ----------
    refused_for : int
        Time since a measurement was last accepted, over which others were refused [ns].
    """

    def __init__(self) -> None:
        self._recent: deque[tuple[int, float]] = deque()
        self._total = 0.0
        self._accepted = 0
        self._doubted = (0, 0)  # first and last stamp of a doubt that goes on
        self.refused_for = 0

    @property
    def mean(self) -> float:
        """Mean over the window; about 0.75 for a filter that is right, 0 while there are few."""
        return self._total / len(self._recent) if len(self._recent) >= _FEWEST else 0.0

    @property
    def doubted_for(self) -> int:
        """Time over which ranges have been short again and again [ns]."""
        return self._doubted[1] - self._doubted[0]

    def add(self, innovation: Innovation, window: int) -> None:
        """Take an innovation; forget those that are older than the window [ns]."""
        stamp = innovation.stamp
        if innovation.accepted or not self._accepted:
            self._accepted = max(self._accepted, stamp)
        self.refused_for = stamp - self._accepted
        if innovation.reason == SHORT:
            first, last = self._doubted
            self._doubted = (first if stamp - last < _PAUSE_NS else stamp, stamp)
        weight = _weight(innovation)
        self._recent.append((stamp, weight))
        self._total += weight
        while stamp - self._recent[0][0] > window:
            self._total -= self._recent.popleft()[1]


def _weight(innovation: Innovation) -> float:
    count = max(len(innovation.innovation), 1)
    value = min(innovation.nis, innovation.gate) / count
    if innovation.source == RANGE_SOURCE and innovation.innovation[0] > 0.0:
        return min(value, 1.0)
    return value
