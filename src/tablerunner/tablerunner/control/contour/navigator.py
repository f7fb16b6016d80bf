"""To a target through a room that is not known: reactively, and along contours out of traps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from tablerunner.control.contour.config import ContourConfig
from tablerunner.control.contour.echo_trail import Echo, EchoTrail
from tablerunner.control.contour.round_watch import RoundWatch
from tablerunner.control.contour.wall_follower import LEFT, RIGHT, WallFollower
from tablerunner.control.fuzzy.reactive import ReactiveController
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

_SEEN_RAD = math.radians(104.0)  # the side sensors look so far back
_PAST_RAD = math.radians(5.0)  # a wall beside blocks what is so far to its side
_GAIN_M = 0.1
_ASIDE_RAD = math.radians(25.0)  # what is heard by a slanting sensor is aside
_FAR_M, _ALIKE_M = 2.0, 0.3
_MOVED_M = 0.1
_AT_ONCE_M, _NEAR_M, _FACE_M = 1.0, 2.5, 0.15
_APART_M = 3.0  # of way: leaving the same place sooner is the same leaving


class Mode(Enum):
    """What the robot is about."""

    APPROACH = 'approach'
    CONTOUR = 'contour'
    ARRIVED = 'arrived'
    UNREACHABLE = 'unreachable'


@dataclass(frozen=True, slots=True)
class NavigatorStep:
    """One decision.

    Attributes
    ----------
    velocity : Velocity
        Within the limits of speed and turn rate.
    mode : Mode
    side : int
        1: contour on the left, by sensor 1; -1: on the right, by sensor 5; 0: none.
    target_distance_m : float
    is_free : bool
        Whether nothing was heard in the target direction.
    reason : str
        Why the target is unreachable, or contour following began; else empty.
    traces : tuple of Trace
        Of corner and speed on the approach, where asked for.
    """

    velocity: Velocity
    mode: Mode
    side: int
    target_distance_m: float
    is_free: bool
    reason: str = ''
    traces: tuple[Trace, ...] = ()


class ContourNavigator:
    """Lv's way to a target: reactive, and along the contour of what it meets (Lv 4.C).

    Deterministic; ends for every target, arrived or unreachable.

    Parameters
    ----------
    config : ContourConfig
    reactive : ReactiveController
        Its limits are kept here too. Accelerations are the caller's to limit.
    mounts : tuple of Pose2
        Poses of the five sensors in base_link, in the order of `SENSORS`.

    Attributes
    ----------
    traced : bool
        Whether steps are to tell which rules fired.
    """

    def __init__(
        self, config: ContourConfig, reactive: ReactiveController, mounts: tuple[Pose2, ...]
    ) -> None:
        self.config = config
        self.reactive = reactive
        self.traced = False
        self._trail = EchoTrail(mounts, config.memory, config.look)
        self._wall = WallFollower(config, self._trail)
        self._round = RoundWatch(config.shortest_round)
        self._target: tuple[float, float] | None = None
        self._forget()

    def go(self, target: tuple[float, float]) -> None:
        """Take a target, x and y in map [m]; what was learned on the way to the last is forgotten.

        Raises
        ------
        ValueError
            It is not finite.
        """
        if not (math.isfinite(target[0]) and math.isfinite(target[1])):
            raise ValueError('the target must be finite')
        self._target = target
        self._forget()

    def _forget(self) -> None:
        self._trail.reset()
        self._mode = Mode.APPROACH
        self._reason = ''
        self._looks_far = True
        self._met: list[tuple[float, Pose2, int]] = []  # and side of each meeting
        self._left: list[tuple[float, Pose2]] = []  # way and place of each leaving
        self._way_m = 0.0
        self._last: Pose2 | None = None
        self._rest: Pose2 | None = None
        self._still_s = 0.0
        self._met_m = math.inf  # target distance where the contour began
        self._free_s = self._open_s = 0.0
        self._nearest_m, self._no_gain_s = math.inf, 0.0

    def step(self, readings: Readings, pose: Pose2, dt: float) -> NavigatorStep:
        """Return what to do now; `pose` is base_link in map, `dt` [s] since the last step.

        Raises
        ------
        ValueError
            No target was given, or the pose is not finite.
        """
        target = self._target
        if target is None:
            raise ValueError('there is no target to go to')
        if not pose.is_finite:
            raise ValueError('the pose is not finite')
        self._trail.hear(readings, pose, dt)
        self._measure(pose, dt)
        east, north = target[0] - pose.x, target[1] - pose.y
        away = math.hypot(east, north)
        if self._mode in (Mode.ARRIVED, Mode.UNREACHABLE):
            return self._stand(away)
        if away <= self.config.position_tolerance:
            self._mode = Mode.ARRIVED
            return self._stand(away)
        if self._way_m > self.config.longest_way:
            return self._give_up(away, f'no way found in {self._way_m:.0f} m')
        if self._still_s > self.config.stuck_after:
            return self._give_up(away, f'stands still since {self._still_s:.0f} s')
        if self._mode is Mode.APPROACH:
            return self._approach(readings, pose, target, dt, away)
        return self._along(readings, pose, target, dt, away)

    def _approach(
        self, readings: Readings, pose: Pose2, target: tuple[float, float], dt: float, away: float
    ) -> NavigatorStep:
        course = math.atan2(target[1] - pose.y, target[0] - pose.x)
        config = self.config
        if away < self._nearest_m - _GAIN_M:
            self._nearest_m, self._no_gain_s = away, 0.0
        self._no_gain_s += dt
        bearing = difference(course, pose.heading)
        blocking = None
        if abs(bearing) <= _SEEN_RAD:
            near = min(config.notice, away)
            blocking = self._trail.in_strip(pose, course, near, config.half_width)
        decided = self.reactive.step(readings, pose, target, self.traced)
        velocity = decided.velocity
        if velocity.linear_m_s > 0.0 and blocking is None:
            ahead = min(config.gap, away)
            blocking = self._trail.in_strip(pose, pose.heading, ahead, config.hull_width)
        if blocking is not None or self._no_gain_s > config.patience:
            self._begin_contour(readings, pose, away, bearing, blocking)
            reason = 'no progress' if blocking is None else 'in the way'
            return self._contour_step(readings, pose, away, False, reason)
        velocity = Velocity(
            min(velocity.linear_m_s, config.approach_speed), velocity.angular_rad_s
        )
        return NavigatorStep(velocity, Mode.APPROACH, 0, away, True, '', decided.traces)

    def _along(
        self, readings: Readings, pose: Pose2, target: tuple[float, float], dt: float, away: float
    ) -> NavigatorStep:
        course = math.atan2(target[1] - pose.y, target[0] - pose.x)
        config = self.config
        is_free = self._is_free(
            readings, pose, away, course, config.look
        ) and not self._trail.known_in_strip(pose, course, away, config.hull_width)
        self._free_s = self._free_s + dt if is_free else 0.0
        nearer = away < self._met_m - config.gain
        opens = nearer and self._is_free(readings, pose, away, course, config.gap)
        self._open_s = self._open_s + dt if opens else 0.0
        if self._may_leave(pose, nearer) or self._wall.is_lost:
            self._left.append((self._way_m, pose))
            self._begin_approach()
            return self._approach(readings, pose, target, dt, away)
        if self._round.step(pose):
            return self._give_up(away, 'went round without a way out')
        return self._contour_step(readings, pose, away, is_free)

    def _contour_step(
        self, readings: Readings, pose: Pose2, away: float, is_free: bool, reason: str = ''
    ) -> NavigatorStep:
        after = self.reactive.config.stale_after
        velocity = Velocity()
        if not readings.stale(after):  # blind: stand
            velocity = self.reactive.limits.clamp(self._wall.step(readings, pose, after))
        return NavigatorStep(velocity, Mode.CONTOUR, self._wall.side, away, is_free, reason)

    def _is_free(
        self, readings: Readings, pose: Pose2, away: float, course: float, reach: float
    ) -> bool:
        """Return whether nothing is heard towards the target up to `reach` [m].

        Where no sensor looks, and beyond a wall that is followed, it is not free.
        """
        config, side = self.config, self._wall.side
        bearing = difference(course, pose.heading)
        if abs(bearing) > _SEEN_RAD or readings.stale(self.reactive.config.stale_after):
            return False
        # A wall goes on beyond what was heard of it.
        if self._wall.hears_wall(readings) and side * bearing > _PAST_RAD:
            return False
        length = min(reach, away)
        return self._trail.in_strip(pose, course, length, config.half_width) is None

    def _may_leave(self, pose: Pose2, nearer: bool) -> bool:
        """Return whether the contour is left here.

        The older method leaves wherever it is nearer the target than where the contour began. The
        improved one leaves where the target direction is free, and where it is nearer as soon as
        there is a gap. A place that was left before has not led there: from then on only the
        second counts, by which the places where contours begin come ever nearer.
        """
        if self.config.leave == 'nearer':
            return nearer
        enough = self.config.free_time
        if self._open_s > 0.0 and self._open_s >= enough:
            return True
        if not (self._looks_far and self._free_s > 0.0 and self._free_s >= enough):
            return False
        self._looks_far = not any(
            self._way_m - way > _APART_M and place.distance_to(pose) < self.config.same_place
            for way, place in self._left
        )
        return self._looks_far

    def _begin_approach(self) -> None:
        self._mode = Mode.APPROACH
        self._nearest_m, self._no_gain_s = math.inf, 0.0

    def _begin_contour(
        self, readings: Readings, pose: Pose2, away: float, bearing: float, blocking: Echo | None
    ) -> None:
        """Take up the contour of what is in the way."""
        self._mode = Mode.CONTOUR
        self._met_m = away
        self._free_s = self._open_s = 0.0
        self._round.restart()
        config = self.reactive.config
        used = readings.aged(config.closing_speed, config.reach, config.stale_after)
        if blocking is None:
            sensor = min((1, 2, 3), key=lambda index: used[index])
            at = pose @ self._trail.mounts[sensor] @ Pose2(used[sensor])
            wall = at.x, at.y
        else:
            wall = blocking.x, blocking.y
        at_once = bool(self._left) and self._way_m - self._left[-1][0] < _AT_ONCE_M
        side = 0 if at_once else -self._side_before(pose)
        side = side or _side_aside(wall, pose)
        if at_once:  # right ahead still: the same contour
            side = side or self._met[-1][2]
        side = side or _side_freer(used, bearing)
        self._met.append((self._way_m, pose, side))
        self._wall.begin(side, wall)

    def _side_before(self, pose: Pose2) -> int:
        """Return on which side a contour was had that began near here; 0: there was none."""
        for way, place, side in reversed(self._met):
            away = place.distance_to(pose)
            if self._way_m - way <= _APART_M or away >= _NEAR_M:
                continue
            course = math.atan2(place.y - pose.y, place.x - pose.x)
            # Behind a wall it was another face.
            if not self._trail.known_in_strip(pose, course, away, _FACE_M):
                return side
        return 0

    def _measure(self, pose: Pose2, dt: float) -> None:
        """Keep count of the way, and of the time in which the robot did not move."""
        if self._last is not None:
            self._way_m += self._last.distance_to(pose)
        self._last = pose
        rest = self._rest
        if rest is None or rest.distance_to(pose) > _MOVED_M:
            self._rest, self._still_s = pose, 0.0
        self._still_s += dt

    def _give_up(self, away: float, reason: str) -> NavigatorStep:
        self._mode, self._reason = Mode.UNREACHABLE, reason
        return self._stand(away)

    def _stand(self, away: float) -> NavigatorStep:
        return NavigatorStep(Velocity(), self._mode, 0, away, False, self._reason)


def _side_aside(wall: tuple[float, float], pose: Pose2) -> int:
    """Return on which side of the robot a wall is; 0: right ahead."""
    course = math.atan2(wall[1] - pose.y, wall[0] - pose.x)
    aside = difference(course, pose.heading)
    if abs(aside) <= _ASIDE_RAD:
        return 0
    return LEFT if aside > 0.0 else RIGHT


def _side_freer(used: list[float], bearing: float) -> int:
    """Return the side to have a wall on that is right ahead.

    The robot turns to the freer side, or to the target's if both are alike.
    """
    left, right = (min(a, _FAR_M) + min(b, _FAR_M) for a, b in (used[:2], used[3:]))
    if abs(left - right) > _ALIKE_M:
        return RIGHT if left > right else LEFT
    return RIGHT if bearing > 0.0 else LEFT
