"""When robots come near each other, and whether they pass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

from tablerunner.geometry.pose import Pose2

NEAR_M, AWAY_M, SWING_RAD = 1.0, 1.2, math.pi / 2
"""Two robots meet when they come nearer than the first until they are farther apart than the
second; they cross when the direction from one to the other has swung by more than the third."""


@dataclass
class Meeting:
    """Two robots near each other.

    Attributes
    ----------
    bearing : float
        Direction in map from one to the other, at the last look [rad].
    swung : float
        How far it has turned since they met, counter-clockwise [rad].
    nearest : float
        Least distance so far [m].
    """

    bearing: float
    swung: float = 0.0
    nearest: float = math.inf

    @property
    def crossed(self) -> bool:
        """Whether they passed each other."""
        return abs(self.swung) > SWING_RAD


class Meetings:
    """Watches robots; `past` holds all meetings so far, those under way included."""

    def __init__(self) -> None:
        self.past: list[Meeting] = []
        self._near: dict[tuple[str, str], Meeting] = {}

    def note(self, poses: Mapping[str, Pose2]) -> None:
        """Look at where the robots are; often enough that no bearing swings by half a turn."""
        for pair in combinations(poses, 2):
            here, there = (poses[name] for name in pair)
            gap = here.distance_to(there)
            bearing = math.atan2(there.y - here.y, there.x - here.x)
            meeting = self._near.get(pair)
            if meeting is None:
                if gap >= NEAR_M:
                    continue
                meeting = self._near[pair] = Meeting(bearing)
                self.past.append(meeting)
            elif gap > AWAY_M:
                del self._near[pair]
                continue
            meeting.swung += math.remainder(bearing - meeting.bearing, 2.0 * math.pi)
            meeting.bearing = bearing
            meeting.nearest = min(meeting.nearest, gap)
