"""Where the five sensors lately heard something, as points in map."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from tablerunner.control.fuzzy.readings import SENSORS, Readings
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2


class Echo(NamedTuple):
    """One echo: sensor (index in `SENSORS`), until when it counts, place in map, heading then."""

    sensor: int
    until_s: float
    x: float
    y: float
    heading: float


class EchoTrail:
    """The echoes of the last few seconds, each put in the middle of its sensor's cone.

    Of those that were heard from near by, the place is kept for good, in cells of 0.2 m: they
    tell where walls are.

    Parameters
    ----------
    mounts : tuple of Pose2
        Poses of the sensors in base_link, in the order of `SENSORS`.
    memory_s : float
        How long an echo counts [s].
    reach_m : float
        What is heard farther away than this is not kept: the arc on which it may lie is too wide.
    """

    def __init__(
        self, mounts: tuple[Pose2, ...], memory_s: float = 3.0, reach_m: float = 2.5
    ) -> None:
        if len(mounts) != len(SENSORS):
            raise ValueError(f'{len(SENSORS)} sensors are needed, not {len(mounts)}')
        self.mounts = mounts
        self._memory_s = memory_s
        self._reach_m = reach_m
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._now_s = 0.0
        self._ages = [math.inf] * len(SENSORS)
        self.echoes: deque[Echo] = deque()
        self._cells: set[tuple[int, int]] = set()

    def hear(self, readings: Readings, pose: Pose2, dt: float) -> None:
        """Take what is new in `readings`, `dt` [s] after the last; `pose` is base_link in map."""
        self._now_s += dt
        while self.echoes and self.echoes[0].until_s <= self._now_s:
            self.echoes.popleft()
        for sensor, (distance, age) in enumerate(
            zip(readings.distances_m, readings.ages_s, strict=True)
        ):
            # The same reading has grown older by dt; a new one is younger than that.
            is_new = age < self._ages[sensor] + 0.5 * dt
            self._ages[sensor] = age
            if is_new and distance <= self._reach_m and age < self._memory_s:
                mount = self.mounts[sensor]
                at = pose @ Pose2(
                    mount.x + distance * math.cos(mount.heading),
                    mount.y + distance * math.sin(mount.heading),
                )
                until = self._now_s + self._memory_s
                self.echoes.append(Echo(sensor, until, at.x, at.y, pose.heading))
                if distance <= _SHARP_M:
                    self._cells.add((round(at.x / _CELL_M), round(at.y / _CELL_M)))

    def in_strip(
        self, pose: Pose2, course: float, length: float, half_width: float
    ) -> Echo | None:
        """Return the nearest echo in the strip from `pose` along `course` (map) [m, rad]."""
        cos, sin = math.cos(course), math.sin(course)
        nearest, found = length, None
        for echo in self.echoes:
            dx, dy = echo.x - pose.x, echo.y - pose.y
            along = dx * cos + dy * sin
            if 0.0 < along < nearest and abs(dy * cos - dx * sin) < half_width:
                nearest, found = along, echo
        return found

    def known_in_strip(self, pose: Pose2, course: float, length: float, half_width: float) -> bool:
        """Return whether anything that was ever heard near by lies in the strip."""
        cos, sin = math.cos(course), math.sin(course)
        for column, row in self._cells:
            dx, dy = column * _CELL_M - pose.x, row * _CELL_M - pose.y
            along = dx * cos + dy * sin
            if 0.0 < along < length and abs(dy * cos - dx * sin) < half_width:
                return True
        return False

    def nearest_beside(self, pose: Pose2, side: int, length: float) -> float:
        """Return how far to a side of the robot's way ahead the nearest echo lies [m].

        inf: none on that side, to the left for `side` 1, within `length` ahead.
        """
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        nearest = math.inf
        for echo in self.echoes:
            dx, dy = echo.x - pose.x, echo.y - pose.y
            across = side * (dy * cos - dx * sin)
            if 0.0 < dx * cos + dy * sin < length and 0.0 <= across < nearest:
                nearest = across
        return nearest

    def last_of(self, sensor: int) -> Echo | None:
        """Return the newest echo of a sensor."""
        return next((echo for echo in reversed(self.echoes) if echo.sensor == sensor), None)

    def course_of_wall(self, sensor: int, heading: float, span_m: float = 0.7) -> float | None:
        """Return the direction in map of the wall beside a sensor, on the robot's way [rad].

        The principal axis of the sensor's echoes within `span_m` of the newest one, heard at
        about this heading; None where they are too few or too close together to have one.
        """
        newest = self.last_of(sensor)
        if newest is None:
            return None
        points = [
            (echo.x, echo.y)
            for echo in self.echoes
            if echo.sensor == sensor
            and abs(difference(echo.heading, heading)) < _SAME_FACE_RAD
            and math.hypot(echo.x - newest.x, echo.y - newest.y) <= span_m
        ]
        if len(points) < _LEAST_POINTS:
            return None
        mean_x = sum(x for x, _ in points) / len(points)
        mean_y = sum(y for _, y in points) / len(points)
        xx = sum((x - mean_x) ** 2 for x, _ in points)
        yy = sum((y - mean_y) ** 2 for _, y in points)
        xy = sum((x - mean_x) * (y - mean_y) for x, y in points)
        if math.sqrt((xx + yy) / len(points)) < _LEAST_SPREAD_M:
            return None
        course = 0.5 * math.atan2(2.0 * xy, xx - yy)
        return course if math.cos(course - heading) >= 0.0 else course + math.pi


_SHARP_M = 1.6  # from farther away the arc on which an echo may lie is too wide for a place
_CELL_M = 0.2
_SAME_FACE_RAD = 0.6  # what was heard at another heading is another face
_LEAST_POINTS = 4
_LEAST_SPREAD_M = 0.06  # several times the noise of an echo
