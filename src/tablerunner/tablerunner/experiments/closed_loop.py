"""The whole robot in one process: simulator, ranging, odometry, localiser, mission, safety stop.

The parts are joined as the nodes join them (sim_bridge, uwb_driver, odom_node, fusion_node,
nav_controller, safety_stop), at the same rates, but in measurement time and without ROS: the same
scenario, seed and settings give the same drive bit for bit. What the nodes add and this leaves
out is transport: here a message arrives within the tick of 20 ms in which it was sent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from tablerunner.control import (
    Controller,
    ControllerSettings,
    Destination,
    Localisation,
    Mission,
    MissionConfig,
    MissionStatus,
    PlannerConfig,
    SafetyConfig,
    SafetyDecision,
    SafetyState,
    SafetyStop,
    Situation,
    VelocityLimits,
    home_of,
    limits_within,
    make_controller,
    make_planner,
    make_surroundings,
    sensor_mounts,
)
from tablerunner.control.fuzzy.readings import UltrasonicRing
from tablerunner.estimation import Localizer, LocalizerConfig, LocalizerState, Outcome
from tablerunner.geometry.pose import Pose2
from tablerunner.messages.covariance import largest_deviations
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.odometry.wheels import WheelsConfig
from tablerunner.scenario import Scenario
from tablerunner.simulation import START_NS, Contact, PersonState, Simulator, Truth
from tablerunner.simulation.schedule import Schedule
from tablerunner.types import (
    NANOSECONDS,
    ExchangeSample,
    ImuSample,
    OdometrySample,
    RangeSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
    nanoseconds,
    seconds,
)
from tablerunner.uwb import Ranger, RangerConfig

STEPS_PER_TICK = 2
"""The simulation moves by 20 ms, then everything that was measured is handed on."""

_STATE_PERIOD_NS = NANOSECONDS // 2


@dataclass(frozen=True)
class LoopSettings:
    """How the robot is set up.

    Attributes
    ----------
    controller : str
        One of `tablerunner.control.CONTROLLERS`.
    estimator : str
        One of `tablerunner.estimation.registry.ESTIMATORS`.
    unknown_start : bool
        Whether the robot has to find where it starts; otherwise it is told, as in
        ``tablerunner demo``.
    control_rate, watch_rate : float
        Steps of the mission, and checks of the safety stop, per second [Hz].
    limits, planner, mission, safety, controllers
        Settings of these parts.
    """

    controller: str = 'fuzzy'
    estimator: str = 'ekf'
    unknown_start: bool = False
    control_rate: float = 20.0
    watch_rate: float = 20.0
    limits: VelocityLimits = field(default_factory=VelocityLimits)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    mission: MissionConfig = field(default_factory=MissionConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    controllers: ControllerSettings = field(default_factory=ControllerSettings)


@dataclass(frozen=True, slots=True)
class LoopStep:
    """One control step and what led to it.

    Attributes
    ----------
    stamp : int
        [ns]
    truth : Truth
        Where the robot really is.
    estimate : OdometrySample or None
        The newest pose in map that nav_controller and safety_stop know.
    position_std_m, heading_std_rad : float
        How certain that is; inf: not known.
    wanted : Velocity
        What the mission asks for.
    safety : SafetyDecision
        The newest decision of the safety stop: what the base gets.
    status : MissionStatus
    contacts : tuple of Contact
        Touches that began since the last step.
    people : tuple of PersonState
    """

    stamp: int
    truth: Truth
    estimate: OdometrySample | None
    position_std_m: float
    heading_std_rad: float
    wanted: Velocity
    safety: SafetyDecision
    status: MissionStatus
    contacts: tuple[Contact, ...]
    people: tuple[PersonState, ...]

    @property
    def time_s(self) -> float:
        """Measurement time since the start [s]."""
        return seconds(self.stamp - START_NS)

    @property
    def error_m(self) -> float:
        """How far the estimated position is off [m]; NaN while there is none."""
        if self.estimate is None:
            return float('nan')
        return self.truth.pose.distance_to(self.estimate.pose)


class ClosedLoop:
    """A simulated robot that drives by itself.

    Parameters
    ----------
    scenario : Scenario
        The room as it is.
    seed : int
        Of every random choice.
    settings : LoopSettings, optional
    known : Scenario, optional
        The room as the robot's map has it, when that is not the whole truth.
    start : Pose2, optional
        base_link in map at the start, when not the scenario's.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        settings: LoopSettings | None = None,
        known: Scenario | None = None,
        start: Pose2 | None = None,
    ) -> None:
        self.settings = chosen = settings or LoopSettings()
        self.scenario = scenario
        self.simulator = Simulator(scenario, seed, start)
        room = known or scenario
        robot = room.robot
        ranger = _ranger_config(room)
        self._ranger = Ranger(ranger)
        self._odometer = Odometer(
            OdometerConfig(wheels=WheelsConfig(wheel_radius=robot.wheel_radius, track=robot.track))
        )
        at = self.simulator.truth.pose
        self.localizer = Localizer(
            LocalizerConfig(
                estimator=chosen.estimator,
                tag_position=robot.tag_position,
                initial_pose=() if chosen.unknown_start else (at.x, at.y, at.heading),
            ),
            ranger.anchors,
        )
        limits = limits_within(chosen.limits, robot.limits)
        self.controller: Controller = make_controller(
            chosen.controller, limits, robot, chosen.controllers
        )
        planner = make_planner(room, chosen.planner)
        self.mission = Mission(
            chosen.mission,
            planner,
            self.controller,
            home_of(room),
            make_surroundings(room, planner),
        )
        self._ring = UltrasonicRing()
        self.safety = SafetyStop(
            chosen.safety.replace(footprint_radius=robot.footprint_radius),
            limits,
            sensor_mounts(robot),
        )
        self._control_due = Schedule(1.0 / chosen.control_rate, START_NS)
        # Between two control steps; the watch of the node has any phase.
        self._watch_due = Schedule(1.0 / chosen.watch_rate, START_NS, 0.5 / chosen.control_rate)
        self._watch_ns = nanoseconds(1.0 / chosen.watch_rate)
        self._handlers: dict[type, Callable[[Any], object]] = {
            WheelSample: self._on_wheels,
            ImuSample: self._odometer.add_imu,
            ExchangeSample: self._on_exchange,
            UltrasonicSample: self._on_ultrasonic,
            Contact: self._on_contact,
        }
        self._to_base: Velocity | None = None
        self._sample: OdometrySample | None = None  # odometry/filtered
        self._localisation = Localisation()
        self._fresh = False  # whether the localisation is of that sample
        self._contacts: list[Contact] = []
        self._command: Velocity | None = None  # cmd_vel_nav
        self._command_stamp = 0
        self._sent_at = self._shown_at = 0
        self._shown: tuple[SafetyState, tuple[str, ...]] | None = None
        self._decision = SafetyDecision(Velocity(), SafetyState.STOP)
        self._told: tuple[bool, bool, tuple[float, float] | None] = (False, False, None)

    @property
    def now(self) -> int:
        """Measurement time [ns]."""
        return self.simulator.now_ns

    def drive(
        self, stops: tuple[Destination, ...], return_home: bool = True, longest_s: float = 1800.0
    ) -> Iterator[LoopStep]:
        """Start a mission and yield each control step until it has ended or time is up.

        Raises
        ------
        MissionError, PlanningError
            The mission was not taken on.
        """
        self.mission.start(stops, return_home)
        until = self.now + nanoseconds(longest_s)
        while self.mission.is_busy and self.now < until:
            yield self.step()

    def step(self) -> LoopStep:
        """Go on to the next control step and return it."""
        while True:
            status = self._tick()
            if status is not None:
                break
        contacts, self._contacts = tuple(self._contacts), []
        local = self._local()
        wanted = Velocity() if self._command is None else self._command
        return LoopStep(
            self.now,
            self.simulator.truth,
            self._sample,
            local.position_std_m,
            local.heading_std_rad,
            wanted,
            self._decision,
            status,
            contacts,
            self.simulator.people,
        )

    def _tick(self) -> MissionStatus | None:
        """Move by one tick; return the mission's status where a control step was due."""
        samples = self.simulator.step(self._to_base)
        self._to_base = None
        for _ in range(1, STEPS_PER_TICK):
            samples += self.simulator.step()
        for sample in samples:
            handler = self._handlers.get(type(sample))
            if handler is not None:
                handler(sample)
        now = self.now
        if self._watch_due.is_due(now):
            decision = self._decide()
            if now - self._sent_at >= self._watch_ns:
                self._send(decision)
        return self._control() if self._control_due.is_due(now) else None

    # -- the nodes -----------------------------------------------------------------------------

    def _on_wheels(self, sample: WheelSample) -> None:
        moved = self._odometer.add_wheels(sample)
        if isinstance(moved, OdometrySample):
            self._believe(self.localizer.add_odometry(moved))

    def _on_exchange(self, sample: ExchangeSample) -> None:
        ranged = self._ranger.add(sample)
        if isinstance(ranged, RangeSample):
            self._believe(self.localizer.add_range(ranged))

    def _believe(self, outcome: Outcome) -> None:
        estimate, self._fresh = outcome.estimate, False
        if estimate is None:
            return
        linear, angular = self.localizer.velocity()
        self._sample = OdometrySample(
            estimate.stamp, estimate.pose, linear, angular, estimate.pose_covariance
        )

    def _local(self) -> Localisation:
        sample = self._sample
        if sample is not None and not self._fresh:
            position, heading = largest_deviations(sample.pose_covariance)
            lost = (
                self.localizer.estimate is None
                and self.localizer.status.state is LocalizerState.LOST
            )
            self._localisation = Localisation(sample.stamp, position, heading, lost)
            self._fresh = True
        return self._localisation

    def _on_ultrasonic(self, sample: UltrasonicSample) -> None:
        self._ring.add(sample, self.now)
        if isinstance(self.safety.add_reading(sample, self.now), Refusal):
            return
        before = self._decision.velocity.linear_m_s
        decision = self._decide()
        if decision.velocity.linear_m_s < before:
            self._send(decision)  # braking does not wait for the next command

    def _on_contact(self, contact: Contact) -> None:
        self._contacts.append(contact)

    def _control(self) -> MissionStatus:
        now, sample = self.now, self._sample
        self.mission.hear(self._ring.readings(now))
        blocked, held, obstacle = self._told
        local = self._local()
        situation = Situation(
            now,
            None if sample is None else sample.pose,
            local.stamp,
            local.position_std_m,
            local.heading_std_rad,
            blocked,
            obstacle,
            held,
        )
        velocity, status = self.mission.step(situation)
        self._command, self._command_stamp = velocity, now
        self._send(self._decide())
        return status

    def _decide(self) -> SafetyDecision:
        now, local = self.now, self._local()
        motion, sample = None, self._sample
        timeout = nanoseconds(self.safety.config.pose_timeout)
        if sample is not None and now - local.stamp <= timeout:
            motion = Velocity(sample.linear_m_s, sample.angular_rad_s)
        self._decision = decision = self.safety.step(
            now, self._command, self._command_stamp, local, motion
        )
        shown = (decision.state, decision.reasons)
        if shown != self._shown or now - self._shown_at >= _STATE_PERIOD_NS:
            self._shown, self._shown_at = shown, now
            stopped = decision.state is SafetyState.STOP
            self._told = (
                stopped and decision.blocked,
                stopped and not decision.blocked,
                decision.obstacle,
            )
        return decision

    def _send(self, decision: SafetyDecision) -> None:
        self._to_base = decision.velocity
        self._sent_at = self.now


def _ranger_config(room: Scenario) -> RangerConfig:
    return RangerConfig(
        anchor_ids=tuple(anchor.id for anchor in room.anchors),
        anchor_positions=tuple(value for anchor in room.anchors for value in anchor.position),
    )
