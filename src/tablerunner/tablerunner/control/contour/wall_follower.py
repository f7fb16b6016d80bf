"""Going along a wall at a set distance, by the side sensor 1 or 5."""

from __future__ import annotations

import math

from tablerunner.control.contour.config import ContourConfig
from tablerunner.control.contour.echo_trail import EchoTrail
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

LEFT, RIGHT = 1, -1

_LOST_M = 0.4  # the side sensor hears the wall up to so much beyond the set distance
_FRONT_M = 0.1  # the front sensor needs so much more room than the side sensor
_SLANT_M = 0.3
_CLEARED_M = 0.08
_AHEAD_M = 0.5  # what is to be passed on the other side counts so far ahead
_TOUCH_M = 0.34  # the place of an echo is uncertain by a quarter of its distance
_BEYOND_M, _BEYOND_GAIN = 0.58, 2.0
_ACROSS_GAIN = 1.6  # angle towards the wall over distance too far [rad/m]
_ACROSS_RAD = 0.5
_TURN_GAIN = 2.5  # turn rate over heading error [1/s]
_CLOSING_M_S = 0.3
_LEAST_SPEED_SHARE = 0.3


class WallFollower:
    """Keeps the wall on one side; remembers only what the wall is.

    Where something is ahead it turns away from the wall until it is not (an inner corner); where
    the side sensor hears the wall it keeps to the wall's direction and its distance; where the
    wall has ended it goes round where it ended (an outer corner).

    Parameters
    ----------
    config : ContourConfig
    trail : EchoTrail
        Kept up to date by the caller.
    """

    def __init__(self, config: ContourConfig, trail: EchoTrail) -> None:
        self.config = config
        self._trail = trail
        self.begin(LEFT, (math.inf, math.inf))

    def begin(self, side: int, wall: tuple[float, float]) -> None:
        """Take up a wall to the `side`, of which one point in map is known [m]."""
        self.side = side
        self._wall = wall
        self._turning = True
        self._heading: float | None = None
        self._lost_rad = 0.0

    @property
    def is_lost(self) -> bool:
        """Whether it went all round where the wall ended and there is none."""
        return self._lost_rad > math.tau

    def hears_wall(self, readings: Readings) -> bool:
        """Return whether the side sensor hears the wall."""
        return self._beside(readings) <= self.config.distance + _LOST_M

    def _beside(self, readings: Readings) -> float:
        return readings.distances_m[0 if self.side == LEFT else 4]

    def step(self, readings: Readings, pose: Pose2, stale_after_s: float) -> Velocity:
        """Return the velocity along the wall; `pose` is base_link in map."""
        turned = 0.0 if self._heading is None else abs(difference(pose.heading, self._heading))
        self._heading = pose.heading
        config, side = self.config, self.side
        used = readings.aged(_CLOSING_M_S, self.config.look, stale_after_s)
        near, front, far = used[1], used[2], used[3]
        if side == RIGHT:
            near, far = far, near
        room = _CLEARED_M if self._turning else 0.0
        beyond = self._trail.nearest_beside(pose, -side, _AHEAD_M)
        self._turning = (
            front < config.distance + _FRONT_M + room
            or min(near, far) < _SLANT_M + room
            or beyond < _TOUCH_M
        )
        if self._turning:
            self._note_wall(near, front, far, pose)
            return Velocity(0.0, -side * config.turn_rate)
        sensor = 0 if side == LEFT else 4
        if self.hears_wall(readings):
            self._lost_rad = 0.0
            echo = self._trail.last_of(sensor)
            if echo is not None:
                self._wall = echo.x, echo.y
            along = self._trail.course_of_wall(sensor, pose.heading)
            course = pose.heading if along is None else along
            too_far = self._beside(readings) - config.distance
            limit = _ACROSS_RAD if along is not None else 0.5 * _ACROSS_RAD
        else:
            self._lost_rad += turned
            east, north = self._wall[0] - pose.x, self._wall[1] - pose.y
            course = math.atan2(north, east) - side * math.pi / 2.0
            mount = self._trail.mounts[sensor]
            too_far = math.hypot(east, north) - abs(mount.y) - config.distance
            limit = 2.0 * _ACROSS_RAD
        course += side * min(max(_ACROSS_GAIN * too_far, -limit), limit)
        if beyond < _BEYOND_M:  # towards the wall, from what stands across
            course += side * min(_BEYOND_GAIN * (_BEYOND_M - beyond), _ACROSS_RAD)
        return self._drive(difference(course, pose.heading), front)

    def _note_wall(self, near: float, front: float, far: float, pose: Pose2) -> None:
        """Remember the nearest thing ahead as the wall: the robot turns it to its side."""
        sensors = (1, 2, 3) if self.side == LEFT else (3, 2, 1)
        distance, sensor = min(zip((near, front, far), sensors, strict=True))
        mount = self._trail.mounts[sensor]
        at = pose @ mount @ Pose2(distance)
        self._wall = at.x, at.y

    def _drive(self, error: float, front: float) -> Velocity:
        config = self.config
        rate = min(max(_TURN_GAIN * error, -config.turn_rate), config.turn_rate)
        room = (front - config.distance) / (2.0 * config.distance)
        share = min(max(room, _LEAST_SPEED_SHARE), 1.0) * max(math.cos(error), 0.0)
        return Velocity(config.speed * share, rate)
