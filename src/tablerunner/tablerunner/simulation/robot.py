"""One simulated robot: its base, its sensors, and what it bumps into."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.bumper import Bumper
from tablerunner.simulation.clock import DeviceClock
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.encoders import Encoders
from tablerunner.simulation.imu import Imu
from tablerunner.simulation.magnetometer import Magnetometer
from tablerunner.simulation.radio import Radio
from tablerunner.simulation.sample import Sample
from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.sonar import Sonar
from tablerunner.simulation.streams import stream
from tablerunner.simulation.tag_radio import TagRadio
from tablerunner.simulation.truth import PersonState, RangeTruth, RobotState, Truth
from tablerunner.types import ExchangeSample, Refusal, Velocity


class SimulatedRobot:
    """Everything that moves with one robot.

    Parameters
    ----------
    scenario : Scenario
        As this robot has it: its start, tag and marker.
    seed : int
    start_ns : int
    name : str
        Of one robot among several, which has random streams of its own; '' for the only one.
    clocks : mapping of str to DeviceClock, optional
        Of the room's anchors, where several robots range with them.
    start : Pose2, optional
        base_link in map at the start, when not the scenario's.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        start_ns: int,
        name: str = '',
        clocks: Mapping[str, DeviceClock] | None = None,
        start: Pose2 | None = None,
    ) -> None:
        self.name = name
        self.scenario = scenario
        body, errors = scenario.robot, scenario.sensors
        own = f'{name} ' if name else ''
        at = scenario.start_pose if start is None else start
        self.drive = Drive(body, errors.wheels, at, stream(seed, f'{own}drive'))
        self.encoders = Encoders(errors.wheels, stream(seed, f'{own}encoders'))
        self.imu = Imu(body, errors.imu, self.drive, stream(seed, f'{own}imu'))
        self.magnetometer = Magnetometer(scenario, stream(seed, f'{own}magnetometer'))
        self.radio = Radio(scenario, seed, own, clocks)
        self.tags = TagRadio(scenario, seed)
        self.sonar = Sonar(scenario, stream(seed, f'{own}sonar'))
        self.bumper = Bumper(scenario.outlines, body.footprint_radius)
        self._wheels_due = Schedule(1.0 / errors.wheels.rate, start_ns)
        self._imu_due = Schedule(1.0 / errors.imu.rate, start_ns)
        self._magnetic_due = Schedule(1.0 / errors.magnetic.rate, start_ns)
        self._tags_due = Schedule(1.0 / (errors.uwb.rate * max(self.tags.count, 1)), start_ns)
        self._sonar_due = Schedule(errors.ultrasonic.slot, start_ns)

    def truth(self, now_ns: int) -> Truth:
        """Return where the robot is now and how it moves."""
        drive = self.drive
        return Truth(now_ns, drive.pose, drive.linear_m_s, drive.angular_rad_s)

    @property
    def state(self) -> RobotState:
        """The robot as an obstacle for others."""
        radius = self.scenario.robot.footprint_radius
        return RobotState(self.name, self.drive.pose, self.drive.linear_m_s, radius)

    def command(self, now_ns: int, velocity: Velocity | None) -> tuple[Refusal, ...]:
        """Take a command that arrived, if one did; return why not."""
        if velocity is None or self.drive.command(now_ns, velocity):
            return ()
        return (Refusal(now_ns, 'cmd_vel', '', 'not finite'),)

    def sense(
        self,
        now_ns: int,
        dt_s: float,
        people: Sequence[PersonState],
        robots: Sequence[RobotState],
        ranges: bool,
    ) -> list[Sample]:
        """Return what is measured now, in a fixed order: see `Simulator.step`.

        Parameters
        ----------
        now_ns : int
        dt_s : float
            Since the last step.
        people, robots
            Everybody, and the other robots.
        ranges : bool
            Whether it is the turn of this robot's tag.
        """
        scenario, pose = self.scenario, self.drive.pose
        samples: list[Sample] = []
        self.imu.feel(self.drive, dt_s)
        if self._wheels_due.is_due(now_ns):
            samples.append(self.truth(now_ns))
            samples.append(self.encoders.read(now_ns, self.drive))
        if self._imu_due.is_due(now_ns):
            samples.append(self.imu.read(now_ns, self.drive, 1.0 / scenario.sensors.imu.rate))
        if self._magnetic_due.is_due(now_ns):
            samples.append(self.magnetometer.read(now_ns, pose))
        if ranges:
            samples.extend(_told(*self.radio.exchange(now_ns, pose, people)))
        if self.tags.count and self._tags_due.is_due(now_ns):
            samples.extend(_told(*self.tags.exchange(now_ns, pose, people)))
        if self._sonar_due.is_due(now_ns) and scenario.robot.ultrasonics:
            samples.append(self.sonar.fire(now_ns, pose, (*people, *robots)))
        return samples


def _told(exchange: ExchangeSample | None, truth: RangeTruth) -> tuple[Sample, ...]:
    return (truth,) if exchange is None else (truth, exchange)
