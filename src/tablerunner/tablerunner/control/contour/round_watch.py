"""Whether a robot that follows a contour has been once round it."""

from __future__ import annotations

import math

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2

_SPACING_M = 0.15
_SAME_M = 0.25
_SAME_RAD = 0.6
_ENOUGH = 3  # places in a row


class RoundWatch:
    """Keeps the way along one contour and compares.

    A place counts as been at before when it was passed in the same direction: the two sides of a
    thin wall, or of a narrow passage, are different places. Three in a row are a round.

    Parameters
    ----------
    shortest_m : float
        What lies back less than this is not compared [m].
    """

    def __init__(self, shortest_m: float) -> None:
        self._shortest_m = shortest_m
        self.restart()

    def restart(self) -> None:
        """Begin a new contour."""
        self._way_m = 0.0
        self._last: Pose2 | None = None
        self._places: list[tuple[float, Pose2]] = []
        self._again = 0
        self.is_round = False

    def step(self, pose: Pose2) -> bool:
        """Return whether the contour was gone round; `pose` is base_link in map."""
        if self._last is not None and self._last.distance_to(pose) < _SPACING_M:
            return self.is_round
        if self._last is not None:
            self._way_m += self._last.distance_to(pose)
        self._last = pose
        known = any(
            self._way_m - way >= self._shortest_m
            and math.hypot(pose.x - place.x, pose.y - place.y) < _SAME_M
            and abs(difference(pose.heading, place.heading)) < _SAME_RAD
            for way, place in self._places
        )
        self._again = self._again + 1 if known else 0
        self._places.append((self._way_m, pose))
        self.is_round = self.is_round or self._again >= _ENOUGH
        return self.is_round
