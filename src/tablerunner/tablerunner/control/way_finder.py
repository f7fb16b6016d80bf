"""Ways for a mission: round what the map shows, what is marked, and what the sensors found."""

from __future__ import annotations

from dataclasses import replace

from tablerunner.control.destination import Destination
from tablerunner.control.floor_map import Disc
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.control.surroundings import Surroundings
from tablerunner.errors import PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import nanoseconds, seconds

_LOOK_NS, _LOOK_AGAIN_NS = nanoseconds(0.25), nanoseconds(1.5)
_AHEAD_M = 1.8
_SPACE_M = 0.03
_LONGER_M = 1.5
_WALK_M_S = 0.4  # about the mean speed of a robot that gets on
_MOVED_M = 0.3
_YIELDS_S = 3.0


class WayFinder:
    """Plans, and looks along the way for what the sensors find on it.

    Parameters
    ----------
    planner : Planner
        Of the known floor.
    surroundings : Surroundings or None
        None: the map is all there is.
    """

    def __init__(self, planner: Planner, surroundings: Surroundings | None = None) -> None:
        self.planner = planner
        self.surroundings = surroundings
        self._turned: Pose2 | None = None
        self._yields_since: int | None = None
        self.begin()

    def hear(self, readings: Readings, pose: Pose2, stamp: int) -> None:
        """Take what the sensors hear at `stamp` [ns] with base_link at `pose` in map."""
        if self.surroundings is not None:
            self.surroundings.hear(readings, pose, stamp)

    def is_approached(self, stamp: int) -> bool:
        """Return whether to wait for somebody who has just come nearer by himself.

        Not for ever: from then on the safety stop alone minds those who come and go.
        """
        if self.surroundings is None or not self.surroundings.is_approached(stamp):
            self._yields_since = None
            return False
        if self._yields_since is None:
            self._yields_since = stamp
        return seconds(stamp - self._yields_since) < _YIELDS_S

    def begin(self) -> None:
        """Look along a new path from now on."""
        self._look_at = 0
        self._barred_since: int | None = None

    def way(self, pose: Pose2, stop: Destination, discs: tuple[Disc, ...]) -> Path:
        """Return a way round all that is known of; if need be, of the map and the discs only.

        Raises
        ------
        PlanningError
            There is none.
        """
        seen = self._round(pose, stop, discs)
        if seen is not None:
            return seen
        return self.planner.plan(pose, stop.pose, keep_heading=stop.keep_heading, blocked=discs)

    def _round(self, pose: Pose2, stop: Destination, discs: tuple[Disc, ...]) -> Path | None:
        """Return a way round what the sensors have found, too; None: there is none."""
        if self.surroundings is None or self.surroundings.floor is self.planner.floor:
            return None
        planner = replace(self.planner, floor=self.surroundings.floor)
        try:
            return planner.plan(pose, stop.pose, keep_heading=stop.keep_heading, blocked=discs)
        except PlanningError:
            return None

    def other_way(
        self,
        stamp: int,
        pose: Pose2,
        stop: Destination,
        path: Path,
        left_m: float,
        discs: tuple[Disc, ...],
    ) -> Path | None:
        """Return another way where something was found on this one; None: keep to it.

        For a way that is much longer it is first waited as long as it would take: the thing may
        walk on, and near by the sensors tell better how wide it is.

        Parameters
        ----------
        stamp : int
            [ns]
        pose : Pose2
            base_link in map.
        stop : Destination
        path : Path
            What is being followed.
        left_m : float
            What is left of it.
        discs : tuple of Disc
            More places to keep away from.
        """
        found = self.surroundings
        if found is None or stamp < self._look_at:
            return None
        self._look_at = stamp + _LOOK_NS
        radius = self.planner.footprint_radius + _SPACE_M
        if not found.is_in_the_way(path, max(path.length - left_m, 0.0), _AHEAD_M, radius):
            self._barred_since = None
            return None
        if self._barred_since is None:
            self._barred_since = stamp
        self._look_at = stamp + _LOOK_AGAIN_NS
        other = self._round(pose, stop, discs)
        if other is None:
            return None
        longer = other.length - left_m
        waited_s = seconds(stamp - self._barred_since)
        if longer > _LONGER_M and waited_s < longer / _WALK_M_S:
            return None
        self._barred_since = None
        return other

    def has_moved(self, pose: Pose2) -> bool:
        """Return whether the robot has moved since this was last true; it was not, at first.

        One that changes its mind without moving is stuck.
        """
        if self._turned is not None and self._turned.distance_to(pose) <= _MOVED_M:
            return False
        self._turned = pose
        return True
