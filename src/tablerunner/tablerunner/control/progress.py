"""Whether a robot that wants to move gets anywhere."""

from __future__ import annotations

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import seconds

_WAY_M = 0.08
_TURN_RAD = 0.35


class ProgressWatch:
    """Measures for how long the way left has not become shorter."""

    def __init__(self) -> None:
        self._best = float('inf')
        self._heading = 0.0
        self._since: int | None = None

    def restart(self) -> None:
        """Begin anew: a new path, or the robot was not meant to move."""
        self._since = None

    def stuck_s(self, stamp: int, pose: Pose2, distance_left: float, held: bool) -> float:
        """Return for how long there has been no progress [s].

        A shorter way left is progress; so is turning on the spot, unless the robot is `held` by
        something in its way (then it only fidgets).
        """
        turned = abs(difference(pose.heading, self._heading)) > _TURN_RAD
        if self._since is None or distance_left < self._best - _WAY_M or (turned and not held):
            self._best = distance_left
            self._heading = pose.heading
            self._since = stamp
        return seconds(stamp - self._since)
