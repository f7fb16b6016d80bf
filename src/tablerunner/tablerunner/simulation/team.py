"""Several simulated robots in one room, stepped in fixed small steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Member, Scenario
from tablerunner.simulation.camera import CameraFeed, RobotView
from tablerunner.simulation.people import Crowd
from tablerunner.simulation.radio import device_clock
from tablerunner.simulation.robot import SimulatedRobot
from tablerunner.simulation.sample import Sample
from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.truth import PersonState, RobotState
from tablerunner.types import NANOSECONDS, ImageSample, Velocity, seconds

STEP_NS = 10_000_000
"""Length of a step: 10 ms."""

START_NS = NANOSECONDS
"""Stamp of the start; not zero, which means 'no time' in ROS."""

NOTHING: Mapping[str, Velocity] = {}


@dataclass(frozen=True, slots=True)
class TeamStep:
    """What one step of a room with several robots brings.

    Attributes
    ----------
    samples : dict of str to list of Sample
        Of each robot by its name, in the order that `Simulator.step` has.
    image : ImageSample or None
        The picture that arrived, of all of them.
    """

    samples: dict[str, list[Sample]]
    image: ImageSample | None


class Team:
    """Robots that are in each other's way, seen by one camera, with one set of anchors.

    Their tags take turns in the slots of ``sensors.uwb.rate`` times the anchors a second: with n
    robots each anchor hears each tag ``rate`` / n times a second.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of every random choice.
    robots : sequence of Member
        Those of the scenario that take part; none: the one robot of the scenario, called ''.
    start : Pose2, optional
        Of the one robot, when not the scenario's.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        robots: Sequence[Member] = (),
        start: Pose2 | None = None,
    ) -> None:
        self.scenario = scenario
        self.seed = seed
        self.now_ns = START_NS
        errors = scenario.sensors.uwb
        if robots:
            clocks = {
                anchor.id: device_clock(errors, anchor.id, seed) for anchor in scenario.anchors
            }
            self.robots = tuple(
                SimulatedRobot(scenario.seen_by(member), seed, START_NS, member.name, clocks)
                for member in robots
            )
        else:
            self.robots = (SimulatedRobot(scenario, seed, START_NS, start=start),)
        self.crowd = Crowd(scenario.people, seed)
        self.camera = CameraFeed(scenario, seed, START_NS) if scenario.camera else None
        self._slots = Schedule(1.0 / (errors.rate * max(len(scenario.anchors), 1)), START_NS)
        self._turn = 0

    @property
    def people(self) -> tuple[PersonState, ...]:
        """Where everybody is now."""
        return self.crowd.states

    def robot(self, name: str) -> SimulatedRobot:
        """Return a robot by its name.

        Raises
        ------
        KeyError
            There is none.
        """
        for robot in self.robots:
            if robot.name == name:
                return robot
        raise KeyError(name)

    def step(self, commands: Mapping[str, Velocity] = NOTHING) -> TeamStep:
        """Advance by one step of 10 ms.

        Parameters
        ----------
        commands : mapping of str to Velocity
            By robot: what arrived since the last step, as for `Simulator.step`.
        """
        samples: dict[str, list[Sample]] = {}
        dt_s, radius = seconds(STEP_NS), self.scenario.robot.footprint_radius
        for robot in self.robots:
            samples[robot.name] = [*robot.command(self.now_ns, commands.get(robot.name))]
        self.now_ns += STEP_NS
        now = self.now_ns
        for robot in self.robots:
            robot.drive.step(now, dt_s)
        self.crowd.step(dt_s, [robot.drive.pose for robot in self.robots], radius)
        people = self.people
        # Before anybody is held back, so that both of two that touch feel it.
        moved = [robot.state for robot in self.robots]
        for index, robot in enumerate(self.robots):
            movers: list[PersonState | RobotState] = [*people, *moved[:index]]
            movers += moved[index + 1 :]
            samples[robot.name] += robot.bumper.step(now, robot.drive, dt_s, movers)
        ranging = self._next_tag(now)
        states = [robot.state for robot in self.robots]
        for index, robot in enumerate(self.robots):
            others = states[:index] + states[index + 1 :]
            samples[robot.name] += robot.sense(now, dt_s, people, others, index == ranging)
        return TeamStep(samples, self._look())

    def _next_tag(self, now_ns: int) -> int | None:
        """Return the robot whose tag has this slot; None where none begins."""
        if not self._slots.is_due(now_ns) or not self.scenario.anchors:
            return None
        turn, self._turn = self._turn, (self._turn + 1) % len(self.robots)
        return turn

    def _look(self) -> ImageSample | None:
        if self.camera is None:
            return None
        return self.camera.step(self.now_ns, self._views, self.people)

    def _views(self) -> list[RobotView]:
        return [
            RobotView(
                robot.drive.pose,
                robot.scenario.robot.footprint_radius,
                robot.scenario.robot.marker,
                robot.drive.linear_m_s,
                robot.drive.angular_rad_s,
            )
            for robot in self.robots
        ]
