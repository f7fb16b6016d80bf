"""How fast it is wise to drive where somebody may step into the way."""

from __future__ import annotations

import math

import pytest

from tablerunner.control import FloorMap, floor_map
from tablerunner.control.braking import stopping_distance
from tablerunner.control.caution import Caution, CautionConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, Wall
from tablerunner.types import NANOSECONDS, Velocity, nanoseconds

RADIUS = 0.25
NOW = 10 * NANOSECONDS
CONFIG = CautionConfig()
OUTER = Wall(((0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)), 'outer', closed=True)
POST = Wall(((4.0, 0.0), (4.0, 2.0)), 'post')


def floor(*walls: Wall) -> FloorMap:
    return floor_map(Scenario('room', walls=(OUTER, *walls)))


def test_in_the_open_nobody_hides() -> None:
    caution = Caution(floor(), RADIUS)
    for pose in (Pose2(1.0, 1.0, 0.3), Pose2(4.0, 2.5, 2.0), Pose2(7.5, 4.5, -2.5)):
        assert caution.top_speed(pose, NOW) == math.inf


def test_behind_a_post_somebody_may_stand() -> None:
    caution = Caution(floor(POST), RADIUS)
    # Along the free side of the post's end: hidden is what lies beyond it, below its end.
    near, far = Pose2(3.4, 2.5, 0.0), Pose2(2.8, 2.5, 0.0)
    assert caution.top_speed(near, NOW) < caution.top_speed(far, NOW) < 0.6
    assert caution.top_speed(Pose2(1.0, 2.5, 0.0), NOW) == math.inf
    assert caution.top_speed(Pose2(3.4, 2.5, math.pi), NOW) == math.inf  # driving away from it
    assert caution.top_speed(Pose2(4.6, 2.5, 0.0), NOW) == math.inf  # past it


def test_hidden_gap_is_that_of_the_geometry() -> None:
    caution = Caution(floor(POST), RADIUS)
    # Seen from (3.4, 2.5) past the end (4, 2) at 45 degrees: somebody of radius 0.2 behind the
    # wall is nearest at (4.2 + x, 1.8 - x), 0.99 m away; cells are 0.1 m apart.
    gap = caution.hidden_gap(Pose2(3.4, 2.5, 0.0))
    nearest = math.hypot(4.2 - 3.4, 1.75 - 2.5)
    assert gap == pytest.approx(nearest - RADIUS - CONFIG.body, abs=0.15)


def test_outside_of_the_room_nobody_waits() -> None:
    caution = Caution(floor(), RADIUS)
    assert caution.hidden_gap(Pose2(7.5, 2.5, 0.0)) == math.inf


def test_beside_what_is_not_on_the_map_it_can_still_stand_in_time() -> None:
    caution = Caution(floor(), RADIUS)
    for gap in (0.5, 0.8, 1.2):
        caution.hear(NOW, gap)
        top = caution.top_speed(Pose2(2.0, 2.0, 0.0), NOW)
        needed = stopping_distance(top, CONFIG.delay, CONFIG.deceleration, CONFIG.pace)
        assert needed == pytest.approx(gap, abs=0.01)
        caution = Caution(floor(), RADIUS)


def test_what_was_heard_counts_for_its_time_only() -> None:
    caution = Caution(floor(), RADIUS)
    caution.hear(NOW, 0.5)
    pose = Pose2(2.0, 2.0, 0.0)
    assert caution.top_speed(pose, NOW + nanoseconds(CONFIG.hold - 0.01)) < 0.3
    assert caution.top_speed(pose, NOW + nanoseconds(CONFIG.hold + 0.01)) == math.inf


def test_least_speed_is_kept_and_halved_right_beside_somebody_who_walks() -> None:
    caution = Caution(floor(), RADIUS)
    pose = Pose2(2.0, 2.0, 0.0)
    caution.hear(NOW, 0.31)
    assert caution.top_speed(pose, NOW) == CONFIG.least_speed
    caution.hear(NOW, 0.1)
    assert caution.top_speed(pose, NOW) == CONFIG.least_speed
    caution.meet(NOW - nanoseconds(4.9))
    assert caution.top_speed(pose, NOW + nanoseconds(0.2)) == CONFIG.least_speed
    assert caution.top_speed(pose, NOW) == 0.5 * CONFIG.least_speed


def test_after_somebody_came_nearer_it_is_slower_for_a_while() -> None:
    caution = Caution(floor(), RADIUS)
    pose = Pose2(2.0, 2.0, 0.0)
    caution.meet(NOW)
    assert caution.top_speed(pose, NOW + nanoseconds(CONFIG.busy_time - 0.1)) == CONFIG.busy_speed
    assert caution.top_speed(pose, NOW + nanoseconds(CONFIG.busy_time + 0.1)) == math.inf


def test_slowing_keeps_the_arc_and_lets_turns_and_reverse_alone() -> None:
    caution = Caution(floor(), RADIUS)
    caution.hear(NOW, 0.5)
    pose = Pose2(2.0, 2.0, 0.0)
    slowed = caution.slowed(Velocity(0.6, 0.3), pose, NOW)
    assert slowed.linear_m_s == pytest.approx(caution.top_speed(pose, NOW))
    assert slowed.angular_rad_s / slowed.linear_m_s == pytest.approx(0.5)
    for velocity in (Velocity(0.0, 0.9), Velocity(-0.1, 0.0), Velocity(0.03, 0.0)):
        assert caution.slowed(velocity, pose, NOW) == velocity


def test_pace_of_zero_expects_nobody() -> None:
    caution = Caution(floor(POST), RADIUS, CautionConfig(pace=0.0, hidden_pace=0.0))
    caution.hear(NOW, 0.3)
    assert caution.top_speed(Pose2(3.4, 2.5, 0.0), NOW) == math.inf
