"""Ranging, odometry, estimation and control together in the simulated restaurant, without ROS.

The robot is switched on without being told where it stands: it finds its position from ranges, its
heading by driving, delivers a meal on what the EKF believes, and comes home.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tablerunner.control import (
    FollowerConfig,
    Localisation,
    Mission,
    MissionConfig,
    MissionState,
    MissionStatus,
    PurePursuit,
    SafetyConfig,
    SafetyState,
    SafetyStop,
    Situation,
    VelocityLimits,
    home_of,
    limits_within,
    make_planner,
    sensor_mounts,
    table_stop,
)
from tablerunner.estimation import Localizer, LocalizerConfig, LocalizerState
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.simulation import Contact, Simulator
from tablerunner.types import (
    Anchor,
    ExchangeSample,
    ImuSample,
    OdometrySample,
    RangeSample,
    UltrasonicSample,
    Velocity,
    WheelSample,
)
from tablerunner.uwb import Ranger, RangerConfig

RESTAURANT = (
    Path(__file__).parents[1] / 'src' / 'tablerunner_bringup' / 'scenarios' / 'restaurant.yaml'
)


@dataclass
class Robot:
    """All parts of the robot, wired as the nodes wire them."""

    scenario: Scenario
    seed: int
    contacts: list[Contact] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)
    states: list[MissionState] = field(default_factory=list)
    speed_before_known: float = 0.0

    def __post_init__(self) -> None:
        robot = self.scenario.robot
        self.simulator = Simulator(self.scenario, self.seed)
        places = self.scenario.anchors
        anchors = tuple(Anchor(place.id, place.position) for place in places)
        self.ranger = Ranger(
            RangerConfig(
                anchor_ids=tuple(place.id for place in places),
                anchor_positions=tuple(x for place in places for x in place.position),
            )
        )
        self.odometer = Odometer(OdometerConfig())
        self.localizer = Localizer(LocalizerConfig(tag_position=robot.tag_position), anchors)
        limits = limits_within(VelocityLimits(), robot.limits)
        self.safety = SafetyStop(SafetyConfig(), limits, sensor_mounts(robot))
        self.mission = Mission(
            MissionConfig(),
            make_planner(self.scenario),
            PurePursuit(FollowerConfig(), limits),
            home_of(self.scenario),
        )
        self.motion = Velocity()

    def feel(self, command: Velocity | None) -> None:
        """Advance the world by a step and take in what the sensors measured."""
        outcome = None
        for sample in self.simulator.step(command):
            if isinstance(sample, WheelSample):
                odometry = self.odometer.add_wheels(sample)
                if isinstance(odometry, OdometrySample):
                    self.motion = Velocity(odometry.linear_m_s, odometry.angular_rad_s)
                    outcome = self.localizer.add_odometry(odometry)
            elif isinstance(sample, ImuSample):
                self.odometer.add_imu(sample)
            elif isinstance(sample, ExchangeSample):
                distance = self.ranger.add(sample)
                if isinstance(distance, RangeSample):
                    outcome = self.localizer.add_range(distance)
            elif isinstance(sample, UltrasonicSample):
                self.safety.add_reading(sample, self.simulator.now_ns)
            elif isinstance(sample, Contact):
                self.contacts.append(sample)
            if outcome is not None and outcome.estimate is not None:
                self.estimate = outcome.estimate

    def deliver(self, table: str, limit_s: float) -> MissionStatus:
        """Take a meal to a table and come back."""
        self.mission.start((table_stop(self.scenario, table, 1.0),), return_home=True)
        command, decision, status = None, None, self.mission.status
        for step in range(int(limit_s * 100)):
            self.feel(command)
            command = None
            if step % 5 != 4:
                continue
            now = self.simulator.now_ns
            situation, where = Situation(now), Localisation()
            estimate = getattr(self, 'estimate', None)
            if estimate is not None:
                covariance = estimate.pose_covariance
                position = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
                heading = float(np.sqrt(covariance[2, 2]))
                stopped = decision is not None and decision.state is SafetyState.STOP
                situation = Situation(
                    now,
                    estimate.pose,
                    estimate.stamp,
                    position,
                    heading,
                    stopped and decision.blocked,
                    decision.obstacle if decision is not None else None,
                    stopped and not decision.blocked,
                )
                where = Localisation(estimate.stamp, position, heading)
            velocity, status = self.mission.step(situation)
            self.states.append(status.state)
            decision = self.safety.step(now, velocity, now, where, self.motion)
            command = decision.velocity
            # Where it stands for long, behind walls say, must not count for more.
            moving = abs(self.simulator.truth.linear_m_s) > 0.05
            if moving and self.localizer.status.state is LocalizerState.TRACKING:
                error = estimate.pose.distance_to(self.simulator.truth.pose)
                self.errors_m.append(error)
            if not self.errors_m and situation.heading_std_rad > SafetyConfig().heading_std_slow:
                self.speed_before_known = max(
                    self.speed_before_known, abs(self.simulator.truth.linear_m_s)
                )
            if status.state.is_final:
                return status
        return status


@pytest.fixture(scope='module')
def restaurant() -> Scenario:
    return load_scenario(RESTAURANT)


@pytest.mark.parametrize(('seed', 'table'), [(1, 'table_3'), (2, 'table_10'), (3, 'table_5')])
def test_meal_is_delivered_by_a_robot_that_did_not_know_where_it_stood(
    restaurant: Scenario, seed: int, table: str
) -> None:
    robot = Robot(restaurant, seed)
    status = robot.deliver(table, 240.0)
    assert status.state is MissionState.DONE, status
    assert status.reached == (table, 'kitchen')
    assert MissionState.ALIGNING in robot.states
    # Before it knows where it looks it may only feel its way.
    assert robot.speed_before_known < 0.3
    assert [contact for contact in robot.contacts if contact.robot_at_fault] == []
    # How exact the estimate is is tested with the estimator; here it has to do for driving.
    assert float(np.median(robot.errors_m)) < 0.3
    home = home_of(restaurant).pose
    assert robot.simulator.truth.pose.distance_to(home) < 0.6
