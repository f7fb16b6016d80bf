"""A scenario: the room, what stands and walks in it, the robot, and how its sensors err."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tablerunner.config.build import load
from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario.anchor import AnchorPlace
from tablerunner.scenario.box import Box
from tablerunner.scenario.camera import Camera
from tablerunner.scenario.kitchen import Kitchen
from tablerunner.scenario.member import Member
from tablerunner.scenario.outline import Outline
from tablerunner.scenario.person import Person
from tablerunner.scenario.robot import RobotGeometry
from tablerunner.scenario.sensors import SensorErrors
from tablerunner.scenario.table import Table
from tablerunner.scenario.wall import Wall

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scenario(Config):
    """Everything that a run needs to know of the world; all positions in map.

    Raises
    ------
    ConfigError
        When made from values that do not fit together (see `check`).
    """

    name: str = parameter(description='what people call it')
    walls: tuple[Wall, ...] = parameter((), description='outer and inner walls')
    tables: tuple[Table, ...] = parameter((), description='where meals go')
    boxes: tuple[Box, ...] = parameter((), description='other things in the way')
    kitchen: Kitchen | None = parameter(None, description='where meals come from')
    anchors: tuple[AnchorPlace, ...] = parameter((), description='UWB anchors')
    tag_id: str = parameter('tag', description='address of the UWB tag on the robot')
    people: tuple[Person, ...] = parameter((), description='who walks about')
    routes: dict[str, tuple[tuple[float, float], ...]] = parameter(
        factory=dict, description='named ways to drive, as points in map', unit='m'
    )
    camera: Camera | None = parameter(None, description='camera under the ceiling')
    start: tuple[float, float, float] | None = parameter(
        None,
        description='x, y, heading of the robot at the start; the kitchen when not given',
        unit='m, m, rad',
    )
    robot: RobotGeometry = parameter(factory=RobotGeometry, description='body of the robot')
    robots: tuple[Member, ...] = parameter(
        (), description='several robots; a run takes the first few, or only the one at start'
    )
    sensors: SensorErrors = parameter(
        factory=SensorErrors, description='rates and errors of the simulated sensors'
    )

    @property
    def start_pose(self) -> Pose2:
        """Where base_link stands in map at the start."""
        if self.start is not None:
            return Pose2(*self.start)
        return self.kitchen.stop_pose if self.kitchen is not None else Pose2()

    def team(self, count: int) -> tuple[Member, ...]:
        """Return the first few of the robots.

        Raises
        ------
        ConfigError
            There are not so many.
        """
        if not 0 <= count <= len(self.robots):
            there = f'at most {len(self.robots)}, as {self.name} has under robots'
            raise ConfigError('robots', count, there)
        return self.robots[:count]

    def member(self, name: str) -> Member:
        """Return one of the robots.

        Raises
        ------
        ConfigError
            There is none of this name; the message lists those there are.
        """
        for member in self.robots:
            if member.name == name:
                return member
        names = ', '.join(member.name for member in self.robots)
        raise ConfigError('robot', name, f'one of {names}' if names else 'a scenario with robots')

    def seen_by(self, member: Member) -> Scenario:
        """Return the scenario of one of several robots: its start, its colour, its tag.

        It is loaded where it starts, so that not all want to stand in one place.
        """
        robot, kitchen = self.robot, self.kitchen
        if robot.marker is not None and member.colour is not None:
            robot = robot.replace(marker=robot.marker.replace(colour=member.colour))
        if kitchen is not None:
            kitchen = kitchen.replace(stop=member.start)
        return self.replace(
            robot=robot, kitchen=kitchen, start=member.start, tag_id=member.tag, robots=()
        )

    @property
    def stops(self) -> dict[str, Pose2]:
        """Every place the robot can be sent to by name, the kitchen first."""
        stops = {}
        if self.kitchen is not None:
            stops[self.kitchen.name] = self.kitchen.stop_pose
        stops.update({table.name: table.stop_pose for table in self.tables})
        return stops

    def stop_pose(self, name: str) -> Pose2:
        """Return where the robot stands in map to serve a table or be loaded.

        Raises
        ------
        ConfigError
            There is no such place; the message lists those there are.
        """
        stops = self.stops
        if name not in stops:
            raise ConfigError('stop', name, 'one of ' + ', '.join(stops), self.name)
        return stops[name]

    @cached_property
    def outlines(self) -> tuple[Outline, ...]:
        """Footprints of all walls, tables and boxes, in this order."""
        return (
            *(wall.outline for wall in self.walls),
            *(table.outline for table in self.tables),
            *(box.outline for box in self.boxes),
        )

    @cached_property
    def mapped(self) -> Scenario:
        """The same room as the robot's map knows it: without boxes that are not on it."""
        known = tuple(box for box in self.boxes if not box.unmapped)
        return self if len(known) == len(self.boxes) else self.replace(boxes=known)

    def obstacle_segments(self) -> Array:
        """Return the edges of all that stands in the room, shape (n, 2, 2), in map [m]."""
        if not self.outlines:
            return np.empty((0, 2, 2))
        return np.concatenate([outline.segments for outline in self.outlines])

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x, least y, greatest x, greatest y of all that stands in the room [m]."""
        parts = [outline.corners for outline in self.outlines]
        parts += [np.array([anchor.position[:2] for anchor in self.anchors]).reshape(-1, 2)]
        points = np.concatenate([*parts, [[self.start_pose.x, self.start_pose.y]]])
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def check(self) -> None:
        """Refuse a room that cannot be: see `tablerunner.scenario.rules`."""
        # Here, not above: the rules need this class.
        from tablerunner.scenario.rules import check_scenario

        check_scenario(self)


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a YAML file.

    Raises
    ------
    ConfigError
        With file, line, field and value of the first thing that is wrong.
    """
    return load(Scenario, Path(path))
