"""Robots that all drive at full speed, each behind its own safety stop, at each other."""

from __future__ import annotations

import math

import pytest

from tablerunner.control import (
    Localisation,
    SafetyConfig,
    SafetyStop,
    VelocityLimits,
    limits_within,
    sensor_mounts,
)
from tablerunner.scenario import Member, Scenario, Wall
from tablerunner.simulation import Contact, SimulatedRobot, Team
from tablerunner.types import UltrasonicSample, Velocity

HULL = ((-6.0, -6.0), (6.0, -6.0), (6.0, 6.0), (-6.0, 6.0))
COMMAND = Velocity(0.6, 0.0)


class Guard:
    """One robot's safety stop under a controller that knows only full speed."""

    def __init__(self, robot: SimulatedRobot) -> None:
        body = robot.scenario.robot
        self.safety = SafetyStop(
            SafetyConfig(footprint_radius=body.footprint_radius),
            limits_within(VelocityLimits(), body.limits),
            sensor_mounts(body),
        )
        self.contacts: list[Contact] = []
        self.top_speed = 0.0

    def step(self, now: int, robot: SimulatedRobot, samples: list[object]) -> Velocity:
        """Return what the safety stop lets through after the samples of a step."""
        for sample in samples:
            if isinstance(sample, Contact):
                self.contacts.append(sample)
            elif isinstance(sample, UltrasonicSample):
                assert self.safety.add_reading(sample, now) is None
        truth = robot.truth(now)
        self.top_speed = max(self.top_speed, truth.linear_m_s)
        driven = Velocity(truth.linear_m_s, truth.angular_rad_s)
        where = Localisation(now, 0.05, 0.05)
        return self.safety.step(now, COMMAND, now, where, driven).velocity


def drive(angle_deg: float, seed: int) -> list[Guard]:
    """Let two robots run towards the middle, from 2.5 m away, with an angle between their ways."""
    half = math.radians(angle_deg) / 2.0
    starts = []
    for side in (1.0, -1.0):
        course = side * half
        x, y = -2.5 * math.cos(course), -2.5 * math.sin(course)
        starts.append((x, y, course))
    robots = tuple(Member(f'r{index}', start) for index, start in enumerate(starts))
    room = Scenario('hall', walls=(Wall(HULL, 'hull', closed=True),), robots=robots)
    team = Team(room, seed, robots)
    guards = {robot.name: Guard(robot) for robot in team.robots}
    commands: dict[str, Velocity] = {}
    for _ in range(700):
        samples = team.step(commands).samples
        commands = {
            robot.name: guards[robot.name].step(team.now_ns, robot, samples[robot.name])
            for robot in team.robots
        }
    return list(guards.values())


@pytest.mark.parametrize('angle_deg', [30.0, 60.0, 90.0, 120.0, 150.0, 180.0])
def test_robots_that_drive_at_each_other_do_not_touch(angle_deg: float) -> None:
    guards = drive(angle_deg, round(angle_deg))
    assert [guard.contacts for guard in guards] == [[], []]
    assert all(guard.top_speed > 0.5 for guard in guards)
