"""Robots that serve a room without touching: legs from stop to stop that keep clear of each other.

Each leg is a turn on the spot and a straight drive with known times. A robot that wants to leave
looks ahead where everybody will be, and takes a leg that stays clear of all, of those above all
that lead past other robots closely: what is wanted are crossings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Person
from tablerunner.types import Velocity

Array = NDArray[np.float64]

SPEED_M_S, ACCELERATION_M_S2 = 0.55, 0.4
TURN_RAD_S, TURN_RAD_S2 = 1.0, 1.5
LOOK_S = 0.1
"""How closely a leg is compared with those of others."""

APART_M = 0.62
"""Least distance of two robots, and of a robot and a person: 12 cm more than both radii."""

CLOSE_M = 1.0
"""Legs that pass another robot nearer than this are wanted."""

STAND_S = (0.5, 2.0)
"""How long a robot stands at a stop, least and most."""

DELAYS_S = (0.0, 0.7, 1.4, 2.1)
"""A leg may begin so much later, if that brings it nearer to another robot."""

ALONG, ACROSS, TURN = 1.0, 4.0, 3.0
"""How a robot gets back to its leg: gains of the error along, across and of the heading."""


class Target(NamedTuple):
    """Where a robot should be at a time, and how it should move."""

    pose: Pose2
    linear_m_s: float
    angular_rad_s: float


@dataclass(frozen=True)
class Ramp:
    """A way that begins and ends at rest: acceleration, a constant speed, the same back."""

    length: float
    speed: float
    acceleration: float

    @property
    def rise_s(self) -> float:
        """Time to the highest speed."""
        return min(self.speed / self.acceleration, math.sqrt(self.length / self.acceleration))

    @property
    def duration_s(self) -> float:
        """Time for all of it."""
        if self.length <= 0.0:
            return 0.0
        top = self.acceleration * self.rise_s
        return 2.0 * self.rise_s + (self.length - top * self.rise_s) / top

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return way and speed at times since its begin, which may lie before or after it [s]."""
        if self.length <= 0.0:
            return np.zeros_like(times), np.zeros_like(times)
        rise, total = self.rise_s, self.duration_s
        top = self.acceleration * rise
        since = np.clip(times, 0.0, total)
        left = total - since
        begins, ends = since < rise, left < rise
        way = np.where(
            begins,
            0.5 * self.acceleration * since**2,
            np.where(
                ends,
                self.length - 0.5 * self.acceleration * left**2,
                top * (since - 0.5 * rise),
            ),
        )
        speed = np.minimum(top, self.acceleration * np.minimum(since, left))
        return way, speed


@dataclass(frozen=True)
class Leg:
    """A turn on the spot and a straight drive.

    Attributes
    ----------
    start_s : float
    begin : Pose2
    goal : tuple
        x, y in map [m].
    """

    start_s: float
    begin: Pose2
    goal: tuple[float, float]

    @property
    def heading(self) -> float:
        """Of the drive [rad]; of the robot where there is none."""
        if self.goal == (self.begin.x, self.begin.y):
            return self.begin.heading
        return math.atan2(self.goal[1] - self.begin.y, self.goal[0] - self.begin.x)

    @property
    def turn(self) -> Ramp:
        """The turn on the spot [rad]."""
        return Ramp(abs(wrap(self.heading - self.begin.heading)), TURN_RAD_S, TURN_RAD_S2)

    @property
    def drive(self) -> Ramp:
        """The straight drive [m]."""
        length = math.dist(self.goal, (self.begin.x, self.begin.y))
        return Ramp(length, SPEED_M_S, ACCELERATION_M_S2)

    @property
    def end_s(self) -> float:
        """When the robot stands at the goal."""
        return self.start_s + self.turn.duration_s + self.drive.duration_s

    def places(self, times: Array) -> Array:
        """Return where the robot is at times, shape (k, 2); before and after it stands [m]."""
        way, _ = self.drive.at(times - self.start_s - self.turn.duration_s)
        ahead = np.array([math.cos(self.heading), math.sin(self.heading)])
        return np.asarray([self.begin.x, self.begin.y] + way[:, None] * ahead)

    def target(self, time_s: float) -> Target:
        """Return where the robot should be at a time."""
        since = np.array([time_s - self.start_s])
        turned, rate = (float(item[0]) for item in self.turn.at(since))
        way, speed = (float(item[0]) for item in self.drive.at(since - self.turn.duration_s))
        side = math.copysign(1.0, wrap(self.heading - self.begin.heading))
        heading = wrap(self.begin.heading + side * turned)
        x = self.begin.x + way * math.cos(self.heading)
        y = self.begin.y + way * math.sin(self.heading)
        return Target(Pose2(x, y, heading), speed, side * rate)


def follow(target: Target, pose: Pose2) -> Velocity:
    """Return the velocity that brings a robot back to where it should be (Kanayama)."""
    off = pose.inverse() @ target.pose
    linear = target.linear_m_s * math.cos(off.heading) + ALONG * off.x
    turn = TURN * math.sin(off.heading)
    if target.linear_m_s > 0.0:
        turn += ACROSS * target.linear_m_s * off.y
    return Velocity(linear, target.angular_rad_s + turn)


def walk_places(person: Person, times: Array) -> Array:
    """Return where somebody is who walks there and back without pausing, shape (k, 2) [m]."""
    first = np.array(person.route[0])
    if len(person.route) == 1:
        return np.asarray(np.broadcast_to(first, (len(times), 2)))
    way = np.array(person.route[1]) - first
    length = float(np.hypot(*way))
    gone = (person.start_share * length + person.speed * times) % (2.0 * length)
    return np.asarray(first + (length - np.abs(length - gone))[:, None] * way / length)


class Traffic:
    """Decides who drives where, and when.

    Parameters
    ----------
    starts : mapping of str to Pose2
        Of each robot.
    stops : sequence of (x, y)
        Places that robots drive to [m].
    people : sequence of Person
        Who stand, or walk a straight way there and back without pausing and for nobody.
    segments : ndarray, shape (n, 2, 2)
        What stands in the room [m].
    clear_m : float
        How far from that a robot's middle must stay.
    rng : Generator
    """

    def __init__(
        self,
        starts: Mapping[str, Pose2],
        stops: Sequence[tuple[float, float]],
        people: Sequence[Person],
        segments: Array,
        clear_m: float,
        rng: np.random.Generator,
    ) -> None:
        self._stops = list(stops)
        self._people = list(people)
        self._segments = segments
        self._clear_m = clear_m
        self._rng = rng
        self._legs = {name: Leg(0.0, pose, (pose.x, pose.y)) for name, pose in starts.items()}
        self._leave_s = {name: float(rng.uniform(0.5, 2.0)) for name in starts}
        self.legs = 0

    def target(self, robot: str, time_s: float, pose: Pose2) -> Target:
        """Return where a robot should be now; decides on its next leg when that is due.

        Parameters
        ----------
        robot : str
        time_s : float
        pose : Pose2
            Where it truly is.
        """
        leg = self._legs[robot]
        if time_s >= max(leg.end_s, self._leave_s[robot]):
            chosen = self._choose(robot, time_s, pose)
            if chosen is None:
                self._leave_s[robot] = time_s + 0.5
            else:
                self.legs += 1
                leg = self._legs[robot] = chosen
                self._leave_s[robot] = chosen.end_s + float(self._rng.uniform(*STAND_S))
        if time_s > leg.end_s:
            # It stands: whatever heading it came to a stand with is right.
            end = leg.target(leg.end_s).pose
            return Target(Pose2(pose.x, pose.y, end.heading), 0.0, 0.0)
        return leg.target(time_s)

    def _choose(self, robot: str, time_s: float, pose: Pose2) -> Leg | None:
        """Return a leg that is clear of all, or None."""
        wanted: list[tuple[float, Leg]] = []
        others: list[Leg] = []
        choices = [(goal, delay) for goal in self._stops for delay in DELAYS_S]
        for index in self._rng.permutation(len(choices)):
            goal, delay = choices[index]
            if math.dist(goal, (pose.x, pose.y)) < APART_M:
                continue
            leg = Leg(time_s + delay, pose, goal)
            nearest = self._nearest(robot, leg)
            if nearest < APART_M or not self._is_free(leg):
                continue
            if nearest < CLOSE_M:
                wanted.append((nearest, leg))
            else:
                others.append(leg)
        if wanted:
            return min(wanted, key=lambda item: item[0])[1]
        return others[0] if others else None

    def _nearest(self, robot: str, leg: Leg) -> float:
        """Return the least distance to another robot [m]; 0 where people would be too near.

        From now on until all stand, this one at its goal.
        """
        others = [other for name, other in self._legs.items() if name != robot]
        until = max([leg.end_s, *(other.end_s for other in others)]) + 2.0 * LOOK_S
        times = np.arange(leg.start_s, until, LOOK_S)
        places = leg.places(times)
        for person in self._people:
            if _least(places, walk_places(person, times)) < APART_M:
                return 0.0
        gaps = [_least(places, other.places(times)) for other in others]
        return min(gaps, default=math.inf)

    def _is_free(self, leg: Leg) -> bool:
        way = leg.places(np.arange(leg.start_s, leg.end_s + LOOK_S, LOOK_S))
        return bool(distance_to_segments(way, self._segments).min() > self._clear_m)


def _least(places: Array, others: Array) -> float:
    return float(np.hypot(*(places - others).T).min())
