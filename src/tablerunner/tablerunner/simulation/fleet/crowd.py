"""The people around many robots: `simulation.people.Walker` over arrays.

Nobody sees another run's robot. Between way points a person needs one subtraction a step; only
who is near the robot is looked at closely, and way points are dealt with one by one. Positions
and random draws are those of `Crowd` with the same seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError
from tablerunner.scenario import Person
from tablerunner.simulation.people import AHEAD_RAD, place_on_route
from tablerunner.simulation.streams import stream

Array = NDArray[np.float64]

_UNDECIDED, _WALKS_ON, _STOPS = -1, 0, 1


class FleetCrowd:
    """All people of all runs.

    Parameters
    ----------
    people : sequence of tuple of Person
        Those of each run; the same number in every run.
    seeds : sequence of int
    robot_speed_m_s : float
        Robots are never faster than this.

    Attributes
    ----------
    sizes : ndarray, shape (2, people, runs)
        Radius and height of everybody [m].

    Raises
    ------
    ConfigError
        Runs with different numbers of people.
    """

    def __init__(
        self,
        people: Sequence[tuple[Person, ...]],
        seeds: Sequence[int],
        robot_speed_m_s: float,
    ) -> None:
        counts = {len(some) for some in people}
        if len(counts) > 1:
            raise ConfigError('people', sorted(counts), 'the same number in every run')
        self._people = [list(column) for column in zip(*people, strict=True)]  # [person][run]
        self._shape = shape = (len(self._people), len(seeds))
        self._random = [
            [stream(seed, f'person {who.name}') for who, seed in zip(row, seeds, strict=True)]
            for row in self._people
        ]
        self.sizes = np.stack([self._of('radius'), self._of('height')])
        self._speed = self._of('speed')
        self._keeps = self._of('yield_distance')
        self._patience = self._of('patience')
        self._fastest = self._speed + robot_speed_m_s
        self._next = np.zeros(shape, dtype=np.int64)
        self._forward = np.ones(shape, dtype=bool)
        self._pause_s, self._waited_s = np.zeros(shape), np.zeros(shape)
        self._yields = np.full(shape, _UNDECIDED, dtype=np.int8)
        self._goal = np.zeros((2, *shape))  # the way point ahead
        self._course = np.zeros((2, *shape))  # unit vector to it
        self._left_m = np.zeros(shape)  # distance to it
        self._now_s = 0.0
        self._look_s = np.zeros(shape)  # before this time the robot cannot have come near
        self._walks = np.zeros(shape, dtype=bool)
        for who, row in enumerate(self._people):
            for run, person in enumerate(row):
                x, y, ahead = place_on_route(person)
                self._next[who, run] = ahead
                self._walks[who, run] = len(person.route) > 1 and person.speed > 0.0
                self._aim(who, run, x, y)

    def _of(self, name: str) -> Array:
        values = [[getattr(person, name) for person in row] for row in self._people]
        return np.array(values, dtype=float).reshape(self._shape)

    @property
    def places(self) -> Array:
        """Where everybody is, shape (2, people, runs) [m]."""
        return self._goal - self._course * self._left_m

    def step(self, dt_s: float, robot: Array, robot_radius_m: float) -> None:
        """Let everybody walk on by `dt_s`, with the robots at `robot`, shape (2, runs)."""
        if not self._people:
            return
        self._now_s += dt_s
        pauses = self._pause_s > 0.0
        self._pause_s -= dt_s * pauses
        goes = self._walks & ~pauses
        self._mind_robots(goes, dt_s, robot, robot_radius_m)
        self._left_m -= self._speed * dt_s * goes
        arrived = goes & (self._left_m <= 0.0)
        if arrived.any():
            for who, run in zip(*np.nonzero(arrived), strict=True):
                self._arrive(int(who), int(run))

    def _mind_robots(
        self, goes: NDArray[np.bool_], dt_s: float, robot: Array, radius: float
    ) -> None:
        """Take out of `goes` who stops for the robot."""
        who, run = np.nonzero(goes & (self._look_s <= self._now_s))
        if not len(who):
            return
        course = self._course[:, who, run]
        off = robot[:, run] - self._goal[:, who, run] + course * self._left_m[who, run]
        distance = np.hypot(off[0], off[1])
        gap = distance - radius - self.sizes[0, who, run]
        far_m = gap - self._keeps[who, run]
        self._look_s[who, run] = self._now_s + np.maximum(far_m, 0.0) / self._fastest[who, run]
        ahead = np.sum(off * course, axis=0) > math.cos(AHEAD_RAD) * distance
        minds = (far_m <= 0.0) & ahead
        self._yields[who[~minds], run[~minds]] = _UNDECIDED
        open_ = minds & (self._yields[who, run] == _UNDECIDED)
        for one, its in zip(who[open_], run[open_], strict=True):
            chance = self._people[one][its].yield_probability
            stops = self._random[one][its].random() < chance
            self._yields[one, its] = _STOPS if stops else _WALKS_ON
        stops = minds & ((self._yields[who, run] == _STOPS) | (gap <= 0.0))
        self._waited_s[who, run] = np.where(stops, self._waited_s[who, run] + dt_s, 0.0)
        who, run = who[stops], run[stops]
        goes[who, run] = False
        tired = self._waited_s[who, run] > self._patience[who, run]
        for one, its in zip(who[tired], run[tired], strict=True):
            self._turn_round(int(one), int(its))

    def _arrive(self, who: int, run: int) -> None:
        person, random = self._people[who][run], self._random[who][run]
        beyond = -float(self._left_m[who, run])
        while True:
            x, y = (float(value) for value in self._goal[:, who, run])
            chance, length = random.random(), random.exponential(1.0)
            if chance < person.pause_probability:
                self._pause_s[who, run] = float(length) * person.pause
            count = len(person.route)
            step = 1 if self._forward[who, run] else -1
            if not person.loop and not 0 <= self._next[who, run] + step < count:
                self._forward[who, run] = not self._forward[who, run]
                step = -step
            self._next[who, run] = (self._next[who, run] + step) % count
            self._aim(who, run, x, y)
            if self._pause_s[who, run] > 0.0:
                return
            self._left_m[who, run] -= beyond
            if self._left_m[who, run] > 0.0:
                return
            beyond = -float(self._left_m[who, run])

    def _turn_round(self, who: int, run: int) -> None:
        self._waited_s[who, run] = 0.0
        self._yields[who, run] = _UNDECIDED
        x, y = (float(value) for value in self.places[:, who, run])
        self._forward[who, run] = not self._forward[who, run]
        step = 1 if self._forward[who, run] else -1
        self._next[who, run] = (self._next[who, run] + step) % len(self._people[who][run].route)
        self._aim(who, run, x, y)

    def _aim(self, who: int, run: int, x: float, y: float) -> None:
        """Turn somebody who stands at a place to the way point ahead."""
        route = self._people[who][run].route
        goal = route[min(int(self._next[who, run]), len(route) - 1)]
        dx, dy = goal[0] - x, goal[1] - y
        left = math.hypot(dx, dy)
        self._goal[:, who, run] = goal
        self._left_m[who, run] = left
        self._course[:, who, run] = (dx / left, dy / left) if left > 0.0 else (1.0, 0.0)
