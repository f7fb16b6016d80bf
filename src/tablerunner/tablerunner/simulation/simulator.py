"""The simulated robot and room, stepped in fixed small steps."""

from __future__ import annotations

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.sample import Sample
from tablerunner.simulation.team import Team
from tablerunner.simulation.truth import PersonState, Truth
from tablerunner.types import Velocity


class Simulator:
    """Everything of a scenario in motion; the same seed and commands give the same samples.

    It is a `Team` of one.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of every random choice.
    start : Pose2, optional
        base_link in map at the start, when not the scenario's.
    """

    def __init__(self, scenario: Scenario, seed: int, start: Pose2 | None = None) -> None:
        self.scenario = scenario
        self.seed = seed
        self._team = Team(scenario, seed, start=start)
        robot = self._robot = self._team.robots[0]
        self.drive = robot.drive
        self.encoders = robot.encoders
        self.imu = robot.imu
        self.magnetometer = robot.magnetometer
        self.radio = robot.radio
        self.tags = robot.tags
        self.sonar = robot.sonar
        self.bumper = robot.bumper
        self.crowd = self._team.crowd
        self.camera = self._team.camera

    @property
    def now_ns(self) -> int:
        """Stamp of the last step."""
        return self._team.now_ns

    @property
    def truth(self) -> Truth:
        """Where the robot is now and how it moves."""
        return self._robot.truth(self.now_ns)

    @property
    def people(self) -> tuple[PersonState, ...]:
        """Where everybody is now."""
        return self.crowd.states

    def step(self, command: Velocity | None = None) -> tuple[Sample, ...]:
        """Advance by one step of 10 ms.

        Parameters
        ----------
        command : Velocity or None
            A command that arrived since the last step; None when none did: the base then keeps to
            the last one until that is too old, and stops.

        Returns
        -------
        tuple
            What was measured at the new `now_ns`, in a fixed order: contacts and refused commands
            first, then truth and wheels (together), IMU, magnetometer, UWB (the robot's tag, then
            those that people wear), ultrasonic, camera.
        """
        step = self._team.step({} if command is None else {self._robot.name: command})
        samples = step.samples[self._robot.name]
        return tuple(samples) if step.image is None else (*samples, step.image)
