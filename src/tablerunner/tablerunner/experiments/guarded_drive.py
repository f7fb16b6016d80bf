"""A simulated robot under its safety stop, commanded by whatever one likes.

No planner, no mission, no localisation: what comes as a command goes to the safety stop, as often
and as late as in the node (`nav_controller.safety_node`), and what that lets through to the base.
"""

from __future__ import annotations

import math

from tablerunner.control import (
    Localisation,
    SafetyConfig,
    SafetyDecision,
    SafetyState,
    SafetyStop,
    VelocityLimits,
    limits_within,
    sensor_mounts,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation import START_NS, Contact, Simulator
from tablerunner.simulation.schedule import Schedule
from tablerunner.types import NANOSECONDS, Refusal, UltrasonicSample, Velocity, nanoseconds

POSE = 'pose'
"""In `GuardedDrive.withheld`: no pose comes any more."""

WATCH_S = 0.05
"""The node looks so often whether something has fallen silent."""


class GuardedDrive:
    """A robot that is driven by commands, and stopped by the safety stop alone.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of the errors of wheels and echoes, and of what people do.
    start : Pose2, optional
        base_link in map, when not the scenario's.
    config : SafetyConfig, optional

    Attributes
    ----------
    decision : SafetyDecision
        The newest.
    contacts : list of Contact
        All touches so far.
    refusals : list of Refusal
        Readings that the safety stop did not take.
    withheld : set of str
        Frames of sensors that are not heard any more, and `POSE`.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        start: Pose2 | None = None,
        config: SafetyConfig | None = None,
    ) -> None:
        robot = scenario.robot
        self.scenario = scenario
        self.simulator = Simulator(scenario, seed, start)
        self.limits = limits_within(VelocityLimits(), robot.limits)
        chosen = config or SafetyConfig()
        self.safety = SafetyStop(
            chosen.replace(footprint_radius=robot.footprint_radius),
            self.limits,
            sensor_mounts(robot),
        )
        self.decision = SafetyDecision(Velocity(), SafetyState.STOP)
        self.contacts: list[Contact] = []
        self.refusals: list[Refusal] = []
        self.withheld: set[str] = set()
        self._command: Velocity | None = None
        self._command_stamp = 0
        self._pose_stamp = 0
        self._to_base: Velocity | None = None
        self._sent_at = 0
        self._watch_due = Schedule(WATCH_S, START_NS)

    @property
    def now(self) -> int:
        """Measurement time [ns]."""
        return self.simulator.now_ns

    @property
    def pose(self) -> Pose2:
        """True pose of base_link in map."""
        return self.simulator.truth.pose

    @property
    def speed_m_s(self) -> float:
        """True speed."""
        return self.simulator.truth.linear_m_s

    @property
    def faults(self) -> list[Contact]:
        """The touches that the robot has to answer for."""
        return [contact for contact in self.contacts if contact.robot_at_fault]

    def gap_to(self, person: str) -> float:
        """Return the free space between the hull and somebody [m]."""
        state = next(state for state in self.simulator.people if state.name == person)
        away = math.hypot(state.pose.x - self.pose.x, state.pose.y - self.pose.y)
        return away - state.radius_m - self.scenario.robot.footprint_radius

    def step(self, command: Velocity | None = None) -> None:
        """Move on by 10 ms; a command, where one is given, has just come."""
        if command is not None:
            self._command, self._command_stamp = command, self.now
            self._send(self._decide())
        samples = self.simulator.step(self._to_base)
        self._to_base = None
        if POSE not in self.withheld:
            self._pose_stamp = self.now
        for sample in samples:
            if isinstance(sample, Contact):
                self.contacts.append(sample)
            elif isinstance(sample, UltrasonicSample) and sample.sensor not in self.withheld:
                refusal = self.safety.add_reading(sample, self.now)
                if refusal is not None:
                    self.refusals.append(refusal)
                    continue
                before = self.decision.velocity.linear_m_s
                # Braking does not wait for the next command.
                if self._decide().velocity.linear_m_s < before:
                    self._send(self.decision)
        if self._watch_due.is_due(self.now) and self.now - self._sent_at >= WATCH_S * NANOSECONDS:
            self._send(self._decide())

    def run(self, command: Velocity, duration_s: float) -> None:
        """Repeat a command at 20 Hz for a while."""
        until = self.now + nanoseconds(duration_s)
        count = 0
        while self.now < until:
            self.step(command if count % 5 == 0 else None)
            count += 1

    def _decide(self) -> SafetyDecision:
        truth = self.simulator.truth
        where = Localisation(self._pose_stamp, 0.05, 0.05)
        self.decision = self.safety.step(
            self.now,
            self._command,
            self._command_stamp,
            where,
            Velocity(truth.linear_m_s, truth.angular_rad_s),
        )
        return self.decision

    def _send(self, decision: SafetyDecision) -> None:
        self._to_base = decision.velocity
        self._sent_at = self.now
