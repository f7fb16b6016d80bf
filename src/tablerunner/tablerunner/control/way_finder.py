"""Ways for a mission: round what the map shows, what is marked, and what the sensors found."""

from __future__ import annotations

import math
from dataclasses import replace

from tablerunner.control.blockades import BlockadeConfig, Blockades
from tablerunner.control.caution import Caution, CautionConfig
from tablerunner.control.destination import Destination
from tablerunner.control.floor_map import Disc
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.marks import Marks
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.control.refuge import way_to_refuge
from tablerunner.control.surroundings import Surroundings
from tablerunner.errors import NoWayError, PlanningError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import nanoseconds, seconds

_LOOK_NS, _LOOK_AGAIN_NS = nanoseconds(0.25), nanoseconds(1.5)
_AHEAD_M = 1.8
_WITHIN_M = 0.05  # what is found is wider than it is: a way may lead so near that it seems touched
_LONGER_M = 1.5
_WALK_M_S = 0.4  # about the mean speed of a robot that gets on
_MOVED_M = 0.3
_ASIDE_M = 0.5
_YIELDS_S = 3.0
_TURN_BACK_S, _TURN_BACK_RAD, _BEGIN_M = 6.0, 1.3, 0.6


class WayFinder:
    """Plans, and looks along the way for what the sensors find on it.

    Parameters
    ----------
    planner : Planner
        Of the known floor.
    surroundings : Surroundings or None
        None: the map is all there is.
    caution : CautionConfig, optional
    blockades : BlockadeConfig, optional
    """

    def __init__(
        self,
        planner: Planner,
        surroundings: Surroundings | None = None,
        caution: CautionConfig | None = None,
        blockades: BlockadeConfig | None = None,
    ) -> None:
        self.planner = planner
        self.surroundings = surroundings
        self.caution = Caution(planner.floor, planner.footprint_radius, caution)
        self._marks = Marks()
        self._blockades = Blockades(blockades)
        self._turned: Pose2 | None = None
        self._yields_since: int | None = None
        self.begin()

    def configure(
        self,
        planner: Planner,
        caution: CautionConfig | None = None,
        blockades: BlockadeConfig | None = None,
    ) -> None:
        """Use other settings from now on; None: those there are. What is known stays."""
        self.planner = planner
        if caution is not None:
            self.caution.config = caution
        if blockades is not None:
            self._blockades.config = blockades

    def hear(self, readings: Readings, pose: Pose2, stamp: int, std_m: float) -> None:
        """Take what the sensors hear at `stamp` [ns] with base_link at `pose` in map.

        `std_m` is the standard deviation of its position [m].
        """
        if self.surroundings is not None:
            for gap in self.surroundings.hear(readings, pose, stamp, std_m):
                self.caution.hear(stamp, gap)
            if self.surroundings.is_approached(stamp):
                self.caution.meet(stamp)

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

    def forget(self) -> None:
        """Forget for good where something stood that was met on the way."""
        self._blockades.clear()

    def meet(self, disc: Disc, stamp: int, mark_s: float, stood_s: float) -> int:
        """Take note of what holds the robot up; return how often it did so at this place.

        Ways keep off it for `mark_s` [s] the first time, four times as long the second time, and
        so on: what was there twice is hardly somebody who walks. `stood_s` is how long the robot
        has stood before it [s].
        """
        self._blockades.add(disc, stamp, stood_s)
        times = self._blockades.times(disc, stamp)
        self._marks.add(disc, stamp + nanoseconds(mark_s * times**2))
        return times

    def way(self, pose: Pose2, stop: Destination, stamp: int) -> Path:
        """Return a way round all that is known of; if need be, past what may have gone by now.

        Raises
        ------
        NoWayError
            What stays where it is leaves no way.
        PlanningError
            There is none for another reason.
        """
        path = self._round(pose, stop, stamp)
        if path is not None:
            return path
        try:
            return self._plan(pose, stop, self._discs(stamp))
        except PlanningError:
            self._marks.clear()  # better wait before it than have no way at all
        path = self._round(pose, stop, stamp)
        return self.lasting_way(pose, stop, stamp) if path is None else path

    def way_around(self, pose: Pose2, stop: Destination, stamp: int) -> Path:
        """Return a way round all that is known of.

        Raises
        ------
        PlanningError
            There is none.
        """
        path = self._round(pose, stop, stamp)
        return self._plan(pose, stop, self._discs(stamp)) if path is None else path

    def lasting_way(self, pose: Pose2, stop: Destination, stamp: int) -> Path:
        """Return a way round the map and what stays where it is; raises what `way` does."""
        standing = self._blockades.standing(stamp)
        try:
            return self._plan(pose, stop, standing)
        except NoWayError:
            if not standing:
                raise
            self._plan(pose, stop, ())  # is it the map?
            places = ' and '.join(f'({disc.x:.1f}, {disc.y:.1f})' for disc in standing)
            raise NoWayError(f'something stands in the way at {places}') from None
        except PlanningError:
            if not standing:
                raise
            return self._plan(pose, stop, ())

    def refuge(self, pose: Pose2, disc: Disc, path: Path, left_m: float) -> Path | None:
        """Return a way to where the robot is in nobody's way; see `way_to_refuge`."""
        planner = self.planner
        if self.surroundings is not None:
            planner = replace(planner, floor=self.surroundings.floor)
        return way_to_refuge(planner, pose, disc, path, left_m)

    def is_free(self, stamp: int, pose: Pose2, stop: Destination) -> bool:
        """Return whether a way is free of all that is heard now; looked at now and then."""
        if self.surroundings is None or stamp < self._look_at:
            return False
        self._look_at = stamp + _LOOK_AGAIN_NS
        planner = replace(self.planner, floor=self.surroundings.floor)
        try:
            planner.plan(
                pose,
                stop.pose,
                keep_heading=stop.keep_heading,
                blocked=self._blockades.standing(stamp),
            )
        except PlanningError:
            return False
        return True

    def _discs(self, stamp: int) -> tuple[Disc, ...]:
        return (*self._marks.discs(stamp), *self._blockades.standing(stamp))

    def _plan(self, pose: Pose2, stop: Destination, discs: tuple[Disc, ...]) -> Path:
        return self.planner.plan(pose, stop.pose, keep_heading=stop.keep_heading, blocked=discs)

    def _round(self, pose: Pose2, stop: Destination, stamp: int) -> Path | None:
        """Return a way round what the sensors have found, too; None: there is none."""
        if self.surroundings is None or self.surroundings.floor is self.planner.floor:
            return None
        planner = replace(self.planner, floor=self.surroundings.floor)
        try:
            return planner.plan(
                pose, stop.pose, keep_heading=stop.keep_heading, blocked=self._discs(stamp)
            )
        except PlanningError:
            return None

    def other_way(
        self,
        stamp: int,
        pose: Pose2,
        stop: Destination,
        path: Path,
        left_m: float,
    ) -> Path | None:
        """Return another way where something was found on this one; None: keep to it.

        For a way that is much longer it is first waited as long as it would take, and for one that
        leads back for some seconds: the thing may walk on, and near by the sensors tell better how
        wide it is. A robot among people that turns for each of them gets nowhere.

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
        """
        found = self.surroundings
        if found is None or stamp < self._look_at:
            return None
        self._look_at = stamp + _LOOK_NS
        begin = max(path.length - left_m, 0.0)
        gap = found.gap(path, begin, _AHEAD_M)
        if gap >= self.planner.footprint_radius - _WITHIN_M:
            self._barred_since = None
            return self._roomier(stamp, pose, stop, left_m, gap)
        if self._barred_since is None:
            self._barred_since = stamp
        self._look_at = stamp + _LOOK_AGAIN_NS
        other = self._round(pose, stop, stamp)
        if other is None:
            return None
        longer = other.length - left_m
        patience_s = patience(longer)
        on = max(path.length - left_m, 0.0)
        if _turns(pose, other, 0.0) and not _turns(pose, path, on):
            patience_s = max(patience_s, _TURN_BACK_S)
        if seconds(stamp - self._barred_since) < patience_s:
            return None
        self._barred_since = None
        return other

    def _roomier(
        self,
        stamp: int,
        pose: Pose2,
        stop: Destination,
        left_m: float,
        gap: float,
    ) -> Path | None:
        """Return a way that keeps farther off what was found than one that misses it by `gap`."""
        found, planner = self.surroundings, self.planner
        if found is None or gap >= planner.footprint_radius + planner.config.clearance:
            return None
        self._look_at = stamp + _LOOK_AGAIN_NS
        other = self._round(pose, stop, stamp)
        if other is None or other.length > left_m + _ASIDE_M or _turns(pose, other, 0.0):
            return None
        return other if found.gap(other, 0.0, _AHEAD_M) >= gap + _WITHIN_M else None

    def has_moved(self, pose: Pose2) -> bool:
        """Return whether the robot has moved since this was last true; it was not, at first.

        One that changes its mind without moving is stuck.
        """
        if self._turned is not None and self._turned.distance_to(pose) <= _MOVED_M:
            return False
        self._turned = pose
        return True


def patience(longer: float) -> float:
    """Return how long to wait before a way that is longer by so much [m] is worth it [s]."""
    return longer / _WALK_M_S if longer > _LONGER_M else 0.0


def _turns(pose: Pose2, path: Path, arc: float) -> bool:
    """Return whether a path, from a length along it on, begins by turning back."""
    x, y = path.at(min(arc + _BEGIN_M, path.length))
    course = math.atan2(float(y) - pose.y, float(x) - pose.x)
    return abs(difference(course, pose.heading)) > _TURN_BACK_RAD
