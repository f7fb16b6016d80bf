"""Legs that keep clear of everybody, and lead close past each other."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from tablerunner.experiments.meetings import Meetings
from tablerunner.experiments.shared_room import CLEAR_M, STOPS, room
from tablerunner.experiments.traffic import APART_M, Leg, Ramp, Traffic, follow, walk_places
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import DriveLimits, Person
from tablerunner.simulation.people import Walker


@pytest.mark.parametrize('length', [0.05, 0.7, 5.0])
def test_ramp_goes_all_the_way_within_its_limits(length: float) -> None:
    """Speed is the slope of the way, acceleration that of the speed; both ends are at rest."""
    ramp = Ramp(length, 0.5, 0.4)
    times = np.linspace(-0.5, ramp.duration_s + 0.5, 20_001)
    way, speed = ramp.at(times)
    assert (way[0], way[-1]) == pytest.approx((0.0, length))
    assert (speed[0], speed[-1]) == pytest.approx((0.0, 0.0), abs=1e-12)
    step = times[1] - times[0]
    assert np.abs(np.gradient(way, step) - speed).max() < 0.4 * step
    assert speed.max() <= 0.5 + 1e-12
    # At corners of the speed the difference quotient is anything between the two slopes.
    assert np.abs(np.diff(speed) / step).max() < 0.4 + 1e-6


def test_leg_turns_then_drives_straight() -> None:
    leg = Leg(3.0, Pose2(1.0, 1.0, 3.0), (1.0, 4.0))
    assert leg.target(0.0).pose == Pose2(1.0, 1.0, 3.0)
    turning = leg.target(3.0 + leg.turn.duration_s / 2)
    assert (turning.pose.x, turning.pose.y, turning.linear_m_s) == (1.0, 1.0, 0.0)
    assert turning.pose.heading == pytest.approx((3.0 + math.pi / 2) / 2)
    assert turning.angular_rad_s < 0.0  # the short way round
    end = leg.target(leg.end_s).pose
    assert (end.x, end.y, end.heading) == pytest.approx((1.0, 4.0, math.pi / 2))
    assert leg.places(np.array([leg.end_s]))[0] == pytest.approx((1.0, 4.0))


def test_follow_brings_a_robot_back_to_its_leg() -> None:
    """From 10 cm beside and 5 cm behind; within 1 cm after 7 s, by an exact base."""
    leg = Leg(0.0, Pose2(0.0, 0.0, 0.0), (5.0, 0.0))
    pose, dt = Pose2(-0.05, 0.1, 0.0), 0.05
    for step in range(140):
        told = follow(leg.target(step * dt), pose)
        pose = pose @ Pose2(told.linear_m_s * dt, 0.0, told.angular_rad_s * dt)
    assert leg.target(140 * dt).pose.distance_to(pose) < 0.04  # one step of 0.55 m/s is 3 cm
    assert abs(pose.y) < 0.01


@pytest.mark.parametrize('share', [0.0, 0.4, 1.0])
def test_people_walk_as_they_are_expected_to(share: float) -> None:
    """Otherwise legs would keep clear of where nobody is."""
    person = Person(
        'p',
        ((1.0, 2.0), (3.0, 3.0)),
        start_share=share,
        speed=0.8,
        pause_probability=0.0,
        yield_probability=0.0,
    )
    walker = Walker(person, np.random.default_rng(0))
    for step in range(1, 1001):
        walker.step(0.01, (), 0.25)
        if step % 100 == 0:
            pose = walker.state.pose
            assert walk_places(person, np.array([step * 0.01]))[0] == pytest.approx(
                (pose.x, pose.y), abs=1e-6
            )


@pytest.mark.parametrize('seed', [0, 1])
def test_traffic_keeps_clear_and_crosses(seed: int) -> None:
    """Two minutes of robots that are where they should be: apart from all, often close."""
    scenario = room()
    poses = {member.name: member.start_pose for member in scenario.robots}
    traffic = Traffic(
        poses,
        STOPS,
        scenario.people,
        scenario.obstacle_segments(),
        CLEAR_M,
        np.random.default_rng(seed),
    )
    meetings, nearest, person_gap = Meetings(), math.inf, math.inf
    for step in range(1200):
        time_s = step * 0.1
        poses = {name: traffic.target(name, time_s, pose).pose for name, pose in poses.items()}
        meetings.note(poses)
        nearest = min(
            nearest, *(one.distance_to(two) for one, two in combinations(poses.values(), 2))
        )
        for person in scenario.people:
            x, y = walk_places(person, np.array([time_s]))[0]
            person_gap = min(person_gap, *(math.hypot(p.x - x, p.y - y) for p in poses.values()))
    # Legs are compared every 0.1 s: two at 0.55 m/s are then at most 3 cm nearer between.
    assert nearest > APART_M - 0.03
    assert person_gap > APART_M - 0.07
    assert sum(meeting.crossed for meeting in meetings.past) >= 3
    assert traffic.legs > 20


def test_legs_are_within_the_limits_of_the_base() -> None:
    """Else no robot could keep to them."""
    from tablerunner.experiments import traffic

    limits = DriveLimits()
    assert limits.speed > traffic.SPEED_M_S
    assert limits.acceleration > traffic.ACCELERATION_M_S2
    assert limits.turn_rate > traffic.TURN_RAD_S
    assert limits.turn_acceleration > traffic.TURN_RAD_S2
