"""One delivery tour through a room, and what came of it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import (
    Destination,
    Disc,
    MissionStatus,
    Planner,
    PlannerConfig,
    floor_map,
    home_of,
    table_stop,
)
from tablerunner.errors import PlanningError
from tablerunner.experiments.closed_loop import ClosedLoop, LoopSettings, LoopStep
from tablerunner.experiments.random_room import DriveRoom
from tablerunner.geometry.angles import difference
from tablerunner.simulation import Contact

Array = NDArray[np.float64]

WAIT_S = 2.0
"""Time at each table."""

LIMIT_S = 330.0
"""A tour that takes longer than this for each of its stops, home included, is endless.

A mission ends by itself before that: `MissionConfig.tour_limit`.
"""

THERE_M = 0.4
"""Who says to have arrived must be within this of the stop: tolerance and an error of the pose."""

_KNOWN_RAD = 0.2
_EVERY = 4  # of the control steps are kept of the track


@dataclass(frozen=True)
class Leg:
    """The way to one stop.

    Attributes
    ----------
    stop : str
    is_open : bool
        Whether it can be reached.
    reached : bool
        Whether the robot said that it arrived.
    off_m : float
        How far from the stop it then was; NaN where it was not reached.
    reason : str
        Why it was missed.
    time_s, way_m : float
        What it took.
    shortest_m : float
        Length of the shortest way from the stop before; NaN where the robot did not come from
        there or there is none.
    """

    stop: str
    is_open: bool
    reached: bool
    off_m: float
    reason: str
    time_s: float
    way_m: float
    shortest_m: float

    @property
    def is_right(self) -> bool:
        """Whether it arrived where one can, or told why not where one cannot."""
        if self.is_open:
            return self.reached and self.off_m <= THERE_M
        return not self.reached and bool(self.reason)


@dataclass(frozen=True, eq=False)
class RoomDrive:
    """A tour.

    Attributes
    ----------
    seed : int
    controller, kind : str
    legs : tuple of Leg
        Of the tour, then home.
    contacts : tuple of Contact
    ended : bool
        Whether the mission ended by itself.
    time_s, way_m : float
    rmse_m, worst_m, heading_rmse_rad : float
        Errors of the estimated pose, from when the heading is known.
    events : tuple of (float, str)
        Measurement time [s], and what the mission told.
    track : ndarray, shape (n, 6)
        Time [s], true x, y [m], heading [rad], estimated x, y [m].
    people : ndarray, shape (n, people, 2)
        Where everybody was [m].
    """

    seed: int
    controller: str
    kind: str
    legs: tuple[Leg, ...]
    contacts: tuple[Contact, ...]
    ended: bool
    time_s: float
    way_m: float
    rmse_m: float
    worst_m: float
    heading_rmse_rad: float
    events: tuple[tuple[float, str], ...]
    track: Array
    people: Array

    @property
    def collisions(self) -> tuple[Contact, ...]:
        """Touches that are the robot's fault."""
        return tuple(contact for contact in self.contacts if contact.robot_at_fault)

    @property
    def faults(self) -> tuple[str, ...]:
        """What went wrong, in words; empty when nothing did."""
        words = [
            f'hit {contact.name} at {contact.closing_m_s:.2f} m/s after '
            f'{(contact.stamp - 1_000_000_000) / 1e9:.1f} s'
            for contact in self.collisions
        ]
        if not self.ended:
            words.append(f'still driving after {self.time_s:.0f} s')
        for leg in self.legs:
            if leg.is_right:
                continue
            if not leg.is_open:
                words.append(f'{leg.stop} cannot be reached, and no reason was given')
            elif leg.reached:
                words.append(f'{leg.stop}: said to have arrived {leg.off_m:.2f} m away')
            else:
                words.append(f'{leg.stop} missed: {leg.reason or "not tried"}')
        return tuple(words)

    def as_json(self) -> dict[str, Any]:
        """Return everything but track and people as what JSON knows."""
        content = {
            'seed': self.seed,
            'controller': self.controller,
            'kind': self.kind,
            'faults': list(self.faults),
            'legs': [asdict(leg) for leg in self.legs],
            'contacts': [
                {
                    'time_s': contact.stamp / 1e9 - 1.0,
                    'with': contact.name,
                    'robot_at_fault': contact.robot_at_fault,
                    'closing_m_s': contact.closing_m_s,
                }
                for contact in self.contacts
            ],
            'ended': self.ended,
            'time_s': self.time_s,
            'way_m': self.way_m,
            'rmse_m': self.rmse_m,
            'worst_m': self.worst_m,
            'heading_rmse_rad': self.heading_rmse_rad,
            'events': [[round(time, 2), event] for time, event in self.events],
        }
        return _strict(content)


def _strict(content: dict[str, Any]) -> dict[str, Any]:
    """Return the same with None for what is not finite, which JSON cannot say."""
    found: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, float) and not math.isfinite(value):
            found[name] = None
        elif isinstance(value, list):
            found[name] = [_strict(item) if isinstance(item, dict) else item for item in value]
        else:
            found[name] = value
    return found


def drive_room(
    room: DriveRoom, controller: str, settings: LoopSettings | None = None
) -> RoomDrive:
    """Drive the tour of a room with one controller; the room's seed is that of the drive.

    Parameters
    ----------
    room : DriveRoom
    controller : str
        One of `tablerunner.control.CONTROLLERS`.
    settings : LoopSettings, optional
        Its controller and start are those of the other arguments.
    """
    base = settings or LoopSettings()
    chosen = LoopSettings(
        **{**vars(base), 'controller': controller, 'unknown_start': room.unknown_start}
    )
    loop = ClosedLoop(room.scenario, room.seed, chosen, room.known)
    stops = tuple(table_stop(room.scenario, name, WAIT_S) for name in room.tour)
    keeper = _Keeper(room, (*stops, home_of(room.scenario)))
    for step in loop.drive(stops, longest_s=LIMIT_S * (len(stops) + 1)):
        keeper.add(step)
    return keeper.result(controller)


class _Keeper:
    """Keeps of each step what is asked for afterwards."""

    def __init__(self, room: DriveRoom, tour: tuple[Destination, ...]) -> None:
        self._room = room
        self._tour = tour
        self._shortest = _Shortest(room)
        self._legs: list[Leg] = []
        self._contacts: list[Contact] = []
        self._events: list[tuple[float, str]] = []
        self._track: list[tuple[float, ...]] = []
        self._people: list[list[tuple[float, float]]] = []
        self._errors: list[tuple[float, float]] = []
        self._count = 0
        self._known = False
        self._way = self._leg_way = self._leg_time = 0.0
        self._before: LoopStep | None = None
        self._from: Destination | None = home_of(room.scenario)
        self._ended = False

    def add(self, step: LoopStep) -> None:
        """Take one step."""
        if self._before is not None:
            self._way += self._before.truth.pose.distance_to(step.truth.pose)
        self._before = step
        self._contacts.extend(step.contacts)
        self._events.extend((step.time_s, event) for event in step.status.events)
        self._known = self._known or step.heading_std_rad <= _KNOWN_RAD
        if self._known and step.estimate is not None:
            turned = difference(step.truth.pose.heading, step.estimate.pose.heading)
            self._errors.append((step.error_m, turned))
        if self._count % _EVERY == 0:
            place = (math.nan, math.nan)
            if step.estimate is not None:
                place = step.estimate.pose.x, step.estimate.pose.y
            true = step.truth.pose
            self._track.append((step.time_s, true.x, true.y, true.heading, *place))
            self._people.append([(person.pose.x, person.pose.y) for person in step.people])
        self._count += 1
        self._note_legs(step, step.status)
        self._ended = step.status.state.is_final

    def _note_legs(self, step: LoopStep, status: MissionStatus) -> None:
        """Begin a new leg where a stop was reached or missed in this step."""
        missed = dict(status.missed)
        for stop in self._tour[len(self._legs) : len(status.reached) + len(status.missed)]:
            there = stop.name in status.reached
            start, self._from = self._from, stop if there else None
            self._legs.append(
                Leg(
                    stop.name,
                    stop.name not in self._room.closed,
                    there,
                    step.truth.pose.distance_to(stop.pose) if there else math.nan,
                    missed.get(stop.name, ''),
                    step.time_s - self._leg_time,
                    self._way - self._leg_way,
                    self._shortest.length(start, stop) if there else math.nan,
                )
            )
            self._leg_time, self._leg_way = step.time_s, self._way

    def result(self, controller: str) -> RoomDrive:
        """Return the whole drive."""
        for stop in self._tour[len(self._legs) :]:
            is_open = stop.name not in self._room.closed
            self._legs.append(
                Leg(stop.name, is_open, False, math.nan, '', math.nan, math.nan, math.nan)
            )
        errors = np.array(self._errors).reshape(-1, 2)
        known = len(errors) > 0
        people = np.array(self._people).reshape(len(self._people), -1, 2)
        return RoomDrive(
            self._room.seed,
            controller,
            self._room.kind,
            tuple(self._legs),
            tuple(self._contacts),
            self._ended,
            0.0 if self._before is None else self._before.time_s,
            self._way,
            float(np.sqrt(np.mean(errors[:, 0] ** 2))) if known else math.nan,
            float(np.max(errors[:, 0])) if known else math.nan,
            float(np.sqrt(np.mean(errors[:, 1] ** 2))) if known else math.nan,
            tuple(self._events),
            np.array(self._track).reshape(-1, 6),
            people,
        )


class _Shortest:
    """Shortest ways through a room as it is, people who stand included."""

    def __init__(self, room: DriveRoom) -> None:
        robot = room.scenario.robot
        standing = tuple(
            Disc(*person.route[0], person.radius)
            for person in room.scenario.people
            if len(person.route) == 1
        )
        config = PlannerConfig(comfort_weight=0.0)
        floor = floor_map(room.scenario).with_discs(standing)
        self._planner = Planner(floor, robot.footprint_radius, config)

    def length(self, start: Destination | None, end: Destination) -> float:
        """Return the length of the shortest way [m]; NaN where there is none."""
        if start is None:
            return math.nan
        try:
            return self._planner.plan(start.pose, end.pose, keep_heading=False).length
        except PlanningError:
            return math.nan
