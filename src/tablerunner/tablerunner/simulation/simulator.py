"""The simulated robot and room, stepped in fixed small steps."""

from __future__ import annotations

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.bumper import Bumper
from tablerunner.simulation.camera import CameraFeed
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.encoders import Encoders
from tablerunner.simulation.imu import Imu
from tablerunner.simulation.magnetometer import Magnetometer
from tablerunner.simulation.people import Crowd
from tablerunner.simulation.radio import Radio
from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.sonar import Sonar
from tablerunner.simulation.streams import stream
from tablerunner.simulation.tag_radio import TagRadio
from tablerunner.simulation.truth import Contact, PersonState, RangeTruth, Truth
from tablerunner.types import (
    NANOSECONDS,
    ExchangeSample,
    ImageSample,
    ImuSample,
    MagneticSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
    seconds,
)

STEP_NS = 10_000_000
"""Length of a step: 10 ms."""

START_NS = NANOSECONDS
"""Stamp of the start; not zero, which means 'no time' in ROS."""

Sample = (
    WheelSample
    | ImuSample
    | MagneticSample
    | ExchangeSample
    | UltrasonicSample
    | ImageSample
    | Truth
    | RangeTruth
    | Contact
    | Refusal
)


class Simulator:
    """Everything of a scenario in motion; the same seed and commands give the same samples.

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
        self.now_ns = START_NS
        robot, errors = scenario.robot, scenario.sensors
        at = scenario.start_pose if start is None else start
        self.drive = Drive(robot, errors.wheels, at, stream(seed, 'drive'))
        self.encoders = Encoders(errors.wheels, stream(seed, 'encoders'))
        self.imu = Imu(robot, errors.imu, self.drive, stream(seed, 'imu'))
        self.magnetometer = Magnetometer(scenario, stream(seed, 'magnetometer'))
        self.radio = Radio(scenario, seed)
        self.tags = TagRadio(scenario, seed)
        self.sonar = Sonar(scenario, stream(seed, 'sonar'))
        self.crowd = Crowd(scenario.people, seed)
        self.bumper = Bumper(scenario.outlines, robot.footprint_radius)
        self.camera = CameraFeed(scenario, seed, START_NS) if scenario.camera else None
        self._wheels_due = Schedule(1.0 / errors.wheels.rate, START_NS)
        self._imu_due = Schedule(1.0 / errors.imu.rate, START_NS)
        self._magnetic_due = Schedule(1.0 / errors.magnetic.rate, START_NS)
        links = max(len(scenario.anchors), 1)
        self._uwb_due = Schedule(1.0 / (errors.uwb.rate * links), START_NS)
        self._tags_due = Schedule(1.0 / (errors.uwb.rate * max(self.tags.count, 1)), START_NS)
        self._sonar_due = Schedule(errors.ultrasonic.slot, START_NS)

    @property
    def truth(self) -> Truth:
        """Where the robot is now and how it moves."""
        drive = self.drive
        return Truth(self.now_ns, drive.pose, drive.linear_m_s, drive.angular_rad_s)

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
        samples: list[Sample] = []
        dt_s = seconds(STEP_NS)
        if command is not None and not self.drive.command(self.now_ns, command):
            samples.append(Refusal(self.now_ns, 'cmd_vel', '', 'not finite'))
        self.now_ns += STEP_NS
        now = self.now_ns
        self.drive.step(now, dt_s)
        radius = self.scenario.robot.footprint_radius
        self.crowd.step(dt_s, self.drive.pose, radius)
        samples.extend(self.bumper.step(now, self.drive, dt_s, self.people))
        self.imu.feel(self.drive, dt_s)
        if self._wheels_due.is_due(now):
            samples.append(self.truth)
            samples.append(self.encoders.read(now, self.drive))
        if self._imu_due.is_due(now):
            samples.append(self.imu.read(now, self.drive, 1.0 / self.scenario.sensors.imu.rate))
        if self._magnetic_due.is_due(now):
            samples.append(self.magnetometer.read(now, self.drive.pose))
        if self._uwb_due.is_due(now) and self.scenario.anchors:
            samples.extend(_told(*self.radio.exchange(now, self.drive.pose, self.people)))
        if self.tags.count and self._tags_due.is_due(now):
            samples.extend(_told(*self.tags.exchange(now, self.drive.pose, self.people)))
        if self._sonar_due.is_due(now) and self.scenario.robot.ultrasonics:
            samples.append(self.sonar.fire(now, self.drive.pose, self.people))
        if self.camera is not None:
            image = self.camera.step(self.truth, self.people)
            if image is not None:
                samples.append(image)
        return tuple(samples)


def _told(exchange: ExchangeSample | None, truth: RangeTruth) -> tuple[Sample, ...]:
    return (truth,) if exchange is None else (truth, exchange)
