"""A room that three robots serve under one camera, run by the code of the nodes.

Every picture is drawn and searched for all three; poses and ranges (three tags share the air) go
into a filter of each robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.experiments.meetings import NEAR_M, Meetings
from tablerunner.experiments.traffic import Traffic, follow
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import (
    AnchorPlace,
    Camera,
    Marker,
    Member,
    Person,
    RobotGeometry,
    Scenario,
    Table,
    Wall,
    hue_of,
)
from tablerunner.simulation import START_NS, Contact, Sample, SimulatedRobot, Team, Truth
from tablerunner.simulation.streams import stream
from tablerunner.types import (
    ExchangeSample,
    ImageSample,
    ImuSample,
    Lens,
    OdometrySample,
    PoseSample,
    RangeSample,
    Refusal,
    WheelSample,
    seconds,
)
from tablerunner.uwb import Ranger, RangerConfig
from tablerunner.vision import (
    CameraMount,
    CeilingLocator,
    LocatorConfig,
    MarkerConfig,
    draw_overlay,
)

Array = NDArray[np.float64]

SERVICE_S = 600.0
WIDTH_M, DEPTH_M = 9.0, 6.6
CAMERA = Camera(
    (WIDTH_M / 2, DEPTH_M / 2, 5.2),
    focal=(290.0, 290.0),
    distortion=(-0.13, 0.018, 0.0006, -0.0004, -0.001),
    clutter=25,
)
COLOURS = ((235, 40, 140), (30, 190, 60), (30, 90, 220))
STOPS = (
    *((x, y) for x in (3.0, 5.2, 7.4) for y in (4.75, 1.85)),
    *((1.0, y) for y in (4.5, 3.3, 2.1)),
)
"""At the tables and in the kitchen."""

CLEAR_M = 0.3
COMMAND_S = 0.05

SOURCES = {'camera and UWB': (PoseSample, RangeSample), 'camera': (PoseSample,)}
MISTAKEN_M = 0.25
"""A pose farther than this from where its robot is, is of something else: a robot's radius. Every
pose that is nearer to another robot is, since robots are two radii apart."""


def room() -> Scenario:
    """Return the room: six tables, the camera over the middle, four anchors, three people."""
    corners = ((0.0, 0.0), (WIDTH_M, 0.0), (WIDTH_M, DEPTH_M), (0.0, DEPTH_M))
    return Scenario(
        name='crossings',
        walls=(Wall(corners, 'outer wall', closed=True),),
        tables=tuple(
            Table(f'table_{index}', x, 5.8 if y > 3.0 else 0.8, (x, y, 0.0), length=1.0)
            for index, (x, y) in enumerate(STOPS[:6])
        ),
        anchors=tuple(
            AnchorPlace(
                f'A{index}', (x + (0.2 if x < 1 else -0.2), y + (0.2 if y < 1 else -0.2), 2.25)
            )
            for index, (x, y) in enumerate(corners)
        ),
        start=(1.0, 3.3, 0.0),
        robot=RobotGeometry(marker=Marker(), ultrasonics=()),
        robots=tuple(
            Member(f'robot_{index + 1}', (*stop, 0.0), colour)
            for index, (stop, colour) in enumerate(zip(STOPS[6:], COLOURS, strict=True))
        ),
        people=(
            _walker('guest', ((4.1, 0.6), (4.1, 6.0)), 0.5, 1.7),
            _walker('waiter', ((6.3, 6.0), (6.3, 0.6)), 0.8, 1.9),
            # Between the camera and the way along x = 7.4: who drives there is hidden for a while.
            _walker('tall guest', ((6.75, 3.3),), 0.0, 2.0),
        ),
        camera=CAMERA,
    )


def _walker(
    name: str, route: tuple[tuple[float, float], ...], speed: float, height: float
) -> Person:
    """Return somebody whose way is known beforehand."""
    return Person(
        name,
        route,
        speed=speed,
        height=height,
        pause_probability=0.0,
        yield_probability=0.0,
    )


@dataclass
class Tally:
    """What is counted during a service."""

    pictures: int = 0
    found: int = 0
    mistaken: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    place_errors: list[float] = field(default_factory=list)
    meetings: Meetings = field(default_factory=Meetings)
    found_near: int = 0
    seen_near: int = 0
    contacts: int = 0


@dataclass(frozen=True)
class Service:
    """One service.

    Attributes
    ----------
    tally : Tally
    errors : dict of str to ndarray, shape (k,)
        Distance of estimate and truth of all robots by source [m].
    legs : int
        That were driven.
    paths : dict of str to ndarray, shape (k, 2)
        Where each robot was, for the picture [m].
    view : ndarray of uint8
        The picture in which the robots were nearest to each other, with what was found.
    """

    tally: Tally
    errors: dict[str, Array]
    legs: int
    paths: dict[str, Array]
    view: NDArray[np.uint8]


class Stack:
    """What the nodes of one robot make of its measurements, with a filter for each source."""

    def __init__(self, scenario: Scenario) -> None:
        anchors = tuple(place.anchor for place in scenario.anchors)
        self._ranging = Ranger(
            RangerConfig(
                anchor_ids=tuple(place.id for place in scenario.anchors),
                anchor_positions=tuple(
                    value for place in scenario.anchors for value in place.position
                ),
            )
        )
        self._odometry = Odometer(OdometerConfig())
        start = scenario.start_pose
        config = LocalizerConfig(
            tag_position=scenario.robot.tag_position,
            initial_pose=(start.x, start.y, start.heading),
        )
        self._filters = {name: Localizer(config, anchors) for name in SOURCES}

    def add(self, sample: Sample) -> OdometrySample | None:
        """Take what a sensor says; return odometry, where it made some."""
        if isinstance(sample, ImuSample):
            self._odometry.add_imu(sample)
        elif isinstance(sample, ExchangeSample):
            ranged = self._ranging.add(sample)
            if isinstance(ranged, RangeSample):
                self._filters['camera and UWB'].add_range(ranged)
        elif isinstance(sample, WheelSample):
            moved = self._odometry.add_wheels(sample)
            if isinstance(moved, OdometrySample):
                for fusing in self._filters.values():
                    fusing.add_odometry(moved)
                return moved
        return None

    def add_pose(self, sample: PoseSample) -> None:
        """Take what the camera says."""
        for fusing in self._filters.values():
            fusing.add_pose(sample)

    def errors(self, truth: Pose2) -> dict[str, float]:
        """Return how far each filter's estimate is off [m]."""
        found = {}
        for name, fusing in self._filters.items():
            if fusing.estimate is not None:
                x, y = fusing.estimate.mean[:2]
                found[name] = math.hypot(x - truth.x, y - truth.y)
        return found


class Serving:
    """One service under way."""

    def __init__(self, seed: int) -> None:
        self.scenario = room()
        self.team = Team(self.scenario, seed, self.scenario.robots)
        self.traffic = Traffic(
            {robot.name: robot.drive.pose for robot in self.team.robots},
            STOPS,
            self.scenario.people,
            self.scenario.obstacle_segments(),
            CLEAR_M,
            stream(seed, 'crossings traffic'),
        )
        self.locator = locator_of(self.scenario)
        self.stacks = {robot.name: Stack(robot.scenario) for robot in self.team.robots}
        self.tally = Tally()
        self.errors: dict[str, list[float]] = {name: [] for name in SOURCES}
        self.paths: dict[str, list[tuple[float, float]]] = {name: [] for name in self.stacks}
        self._truths: dict[str, dict[int, Pose2]] = {name: {} for name in self.stacks}
        self._steps = 0
        self._closest, self.view = math.inf, np.zeros((1, 1, 3), dtype=np.uint8)

    @property
    def elapsed_s(self) -> float:
        """Time since the start."""
        return seconds(self.team.now_ns - START_NS)

    def step(self) -> None:
        """Move everything on by one step."""
        commands = {}
        if self._steps % round(COMMAND_S * 100) == 0:
            for robot in self.team.robots:
                target = self.traffic.target(robot.name, self.elapsed_s, robot.drive.pose)
                commands[robot.name] = follow(target, robot.drive.pose)
        self._steps += 1
        step = self.team.step(commands)
        for robot in self.team.robots:
            self._sense(robot, step.samples[robot.name])
        self.tally.meetings.note({robot.name: robot.drive.pose for robot in self.team.robots})
        if step.image is not None:
            self._look(step.image)

    def _sense(self, robot: SimulatedRobot, samples: Sequence[Sample]) -> None:
        stack, truths = self.stacks[robot.name], self._truths[robot.name]
        for sample in samples:
            if isinstance(sample, Truth):
                truths[sample.stamp] = sample.pose
                if len(truths) > 50:
                    del truths[next(iter(truths))]
            elif isinstance(sample, Contact):
                self.tally.contacts += 1
            elif stack.add(sample) is not None:
                for name, error in stack.errors(robot.drive.pose).items():
                    self.errors[name].append(error)
        if self._steps % 20 == 0:
            self.paths[robot.name].append((robot.drive.pose.x, robot.drive.pose.y))

    def _look(self, image: ImageSample) -> None:
        """Give each robot what the camera says of it, and judge that by the truth."""
        truths = {name: poses[image.stamp] for name, poses in self._truths.items()}
        gaps = {
            name: min(pose.distance_to(truths[other]) for other in truths if other != name)
            for name, pose in truths.items()
        }
        found = self.locator.add(image)
        for item in found:
            name = item.key if isinstance(item, Refusal) else item.robot
            self.tally.pictures += 1
            self.tally.seen_near += gaps[name] < NEAR_M
            if isinstance(item, Refusal):
                count = self.tally.refused.get(item.reason, 0)
                self.tally.refused[item.reason] = count + 1
                continue
            self.tally.found += 1
            self.tally.found_near += gaps[name] < NEAR_M
            off = item.sample.pose.distance_to(truths[name])
            self.tally.place_errors.append(off)
            self.tally.mistaken += off > MISTAKEN_M
            self.stacks[name].add_pose(item.sample)
        if min(gaps.values()) < self._closest:
            self._closest = min(gaps.values())
            marker = self.locator.config.marker
            self.view = draw_overlay(image.pixels, self.locator.camera, marker, found)


def locator_of(scenario: Scenario) -> CeilingLocator:
    """Return what ceiling_camera looks with: the camera as it was measured, every robot's hue."""
    camera = CAMERA
    lens = Lens(camera.width, camera.height, camera.focal, camera.middle, camera.distortion)
    names = tuple(member.name for member in scenario.robots)
    marker = MarkerConfig(
        names, tuple(hue_of(colour) for colour in COLOURS), (Marker().height,) * len(names)
    )
    mount = CameraMount(camera.position, camera.yaw, camera.tilt)
    return CeilingLocator(LocatorConfig(mount=mount, marker=marker), lens)


def run_service(seed: int, service_s: float = SERVICE_S) -> Service:
    """Serve for a while."""
    serving = Serving(seed)
    while serving.elapsed_s < service_s:
        serving.step()
    return Service(
        serving.tally,
        {name: np.array(errors) for name, errors in serving.errors.items()},
        serving.traffic.legs,
        {name: np.array(path).reshape(-1, 2) for name, path in serving.paths.items()},
        serving.view,
    )
