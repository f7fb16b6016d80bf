"""People who walk their routes and, mostly, mind the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Person
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import PersonState

AHEAD_RAD = math.radians(70.0)  # the robot is in the way within this of the walking direction


class Walker:
    """One person on a route.

    At a way point the person may pause. When the robot comes into the way within
    ``yield_distance`` the person draws once whether to stop for it; who does not walks on until
    the bodies touch. After ``patience`` of waiting the person turns and goes back the same way.
    """

    def __init__(self, person: Person, random: np.random.Generator) -> None:
        self._person = person
        self._random = random
        self._route = person.route
        self._forward = True
        self._pause_s = 0.0
        self._waited_s = 0.0
        self._yields: bool | None = None  # None: no robot in the way
        self._x, self._y, self._next = place_on_route(person)
        self._heading = 0.0
        self._heading = self._course()
        self.speed_m_s = 0.0

    @property
    def state(self) -> PersonState:
        """Where the person is."""
        pose = Pose2(self._x, self._y, self._heading)
        return PersonState(self._person.name, pose, self.speed_m_s, self._person.radius)

    def step(self, dt_s: float, robots: Sequence[Pose2], robot_radius_m: float) -> None:
        """Walk on by `dt_s`, with robots at `robots` in map."""
        self.speed_m_s = 0.0
        if len(self._route) < 2 or self._person.speed == 0.0:
            return
        if self._pause_s > 0.0:
            self._pause_s -= dt_s
            return
        self._heading = self._course()
        if self._must_stop(robots, robot_radius_m):
            self._waited_s += dt_s
            if self._waited_s > self._person.patience:
                self._turn_round()
            return
        self._waited_s = 0.0
        self._walk(dt_s)

    def _must_stop(self, robots: Sequence[Pose2], robot_radius_m: float) -> bool:
        gaps = [
            gap
            for gap, ahead in (self._gap(robot, robot_radius_m) for robot in robots)
            if ahead and gap <= self._person.yield_distance
        ]
        if not gaps:
            self._yields = None
            return False
        if self._yields is None:
            self._yields = bool(self._random.random() < self._person.yield_probability)
        return self._yields or min(gaps) <= 0.0

    def _gap(self, robot: Pose2, robot_radius_m: float) -> tuple[float, bool]:
        """Return the free space to a robot [m], and whether it is ahead."""
        dx, dy = robot.x - self._x, robot.y - self._y
        gap = math.hypot(dx, dy) - robot_radius_m - self._person.radius
        return gap, abs(wrap(math.atan2(dy, dx) - self._heading)) < AHEAD_RAD

    def _walk(self, dt_s: float) -> None:
        left = self._person.speed * dt_s
        self.speed_m_s = self._person.speed
        while self._pause_s <= 0.0:
            to_x, to_y = self._route[self._next]
            distance = math.hypot(to_x - self._x, to_y - self._y)
            if distance > left:
                self._x += left * math.cos(self._heading)
                self._y += left * math.sin(self._heading)
                return
            left -= distance
            self._x, self._y = to_x, to_y
            self._arrive()
            self._heading = self._course()

    def _arrive(self) -> None:
        chance, length = self._random.random(), self._random.exponential(1.0)
        if chance < self._person.pause_probability:
            self._pause_s = float(length) * self._person.pause
        count = len(self._route)
        step = 1 if self._forward else -1
        if not self._person.loop and not 0 <= self._next + step < count:
            self._forward = not self._forward
            step = -step
        self._next = (self._next + step) % count

    def _turn_round(self) -> None:
        self._waited_s = 0.0
        self._yields = None
        self._forward = not self._forward
        step = 1 if self._forward else -1
        self._next = (self._next + step) % len(self._route)
        self._heading = self._course()

    def _course(self) -> float:
        to_x, to_y = self._route[min(self._next, len(self._route) - 1)]
        if math.hypot(to_x - self._x, to_y - self._y) < 1e-9:
            return self._heading
        return math.atan2(to_y - self._y, to_x - self._x)


def place_on_route(person: Person) -> tuple[float, float, int]:
    """Return where on the route the walk begins and the index of the way point ahead."""
    route = list(person.route)
    if len(route) < 2:
        return route[0][0], route[0][1], 0
    if person.loop:
        route.append(route[0])
    legs = [math.dist(here, there) for here, there in pairwise(route)]
    left = person.start_share * sum(legs)
    for index, (leg, (here, there)) in enumerate(zip(legs, pairwise(route), strict=True)):
        if left <= leg:
            share = left / leg
            x = here[0] + share * (there[0] - here[0])
            y = here[1] + share * (there[1] - here[1])
            return x, y, (index + 1) % len(person.route)
        left -= leg
    return route[-1][0], route[-1][1], (len(route) - 1) % len(person.route)


class Crowd:
    """All people of a scenario."""

    def __init__(self, people: Sequence[Person], seed: int) -> None:
        self._walkers = [
            Walker(person, stream(seed, f'person {person.name}')) for person in people
        ]
        self.states = tuple(walker.state for walker in self._walkers)

    def step(self, dt_s: float, robots: Sequence[Pose2], robot_radius_m: float) -> None:
        """Let everybody walk on by `dt_s`."""
        for walker in self._walkers:
            walker.step(dt_s, robots, robot_radius_m)
        self.states = tuple(walker.state for walker in self._walkers)
