"""Places where something stands that the map does not know, for a while."""

from __future__ import annotations

import math

from tablerunner.control.destination import Situation
from tablerunner.control.floor_map import Disc
from tablerunner.geometry.pose import Pose2

RADIUS_M = 0.3


class Marks:
    """Remembers discs, each until its stamp."""

    def __init__(self) -> None:
        self._marks: tuple[tuple[int, Disc], ...] = ()

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return bool(self._marks)

    def discs(self, stamp: int) -> tuple[Disc, ...]:
        """Return those that count at `stamp` [ns]; older ones are forgotten."""
        self._marks = tuple(mark for mark in self._marks if mark[0] > stamp)
        return tuple(disc for _, disc in self._marks)

    def add(self, disc: Disc, until: int) -> None:
        """Remember one until a stamp [ns]."""
        self._marks = (*self._marks, (until, disc))

    def clear(self) -> None:
        """Forget all."""
        self._marks = ()


def disc_ahead(situation: Situation, pose: Pose2, footprint_radius: float) -> Disc:
    """Return where the thing in the robot's way is taken to stand, in map."""
    reach = footprint_radius + 0.1
    x, y = situation.obstacle if situation.obstacle is not None else (reach, 0.0)
    away = max(math.hypot(x, y), 1e-6)
    # The echo comes from the near side; most of what stands in the way is as deep as the mark.
    share = (max(away, reach) + RADIUS_M) / away
    centre = pose @ Pose2(x * share, y * share, 0.0)
    return Disc(centre.x, centre.y, RADIUS_M)
