"""map -> odom that moves gently: how fast, how far, and not at all when nobody asks."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.estimation.transform_smoother import SmootherConfig, TransformSmoother
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2

TENTH = 100_000_000
poses = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-math.pi, math.pi))
small = st.builds(Pose2, st.floats(-2, 2), st.floats(-2, 2), st.floats(-3.0, 3.0))
steps = st.lists(st.integers(1, 20), min_size=1, max_size=30)


def smoother(time_constant):
    return TransformSmoother(SmootherConfig(transform_smoothing=time_constant))


def deviation(shown, true, in_odom):
    """Return by how much the robot is shown elsewhere: [m], [rad]."""
    here, there = shown @ in_odom, true @ in_odom
    return here.distance_to(there), difference(here.heading, there.heading)


@given(st.lists(st.tuples(poses, poses), min_size=1, max_size=10))
def test_follow_without_smoothing_passes_all_through(items):
    """A time constant of zero publishes the newest transform itself, to the last bit."""
    item = smoother(0.0)
    for count, (true, in_odom) in enumerate(items, 1):
        assert item.follow(count * TENTH, true, true @ in_odom) is true


@given(poses, small, poses, steps, st.floats(0.1, 10.0))
def test_follow_fades_at_the_stated_rate(old, jump, in_odom, gaps, time_constant):
    """After a jump the deviation of the robot is jump times exp(-t / T): no faster, no slower.

    It never grows, never changes side (no overshoot), and place and heading fade alike.
    """
    item = smoother(time_constant)
    assert item.follow(TENTH, old, old @ in_odom) is old
    robot = old @ in_odom
    moved = Pose2(robot.x + jump.x, robot.y + jump.y, robot.heading + jump.heading)
    new = moved @ in_odom.inverse()
    first, turned = deviation(old, new, in_odom)
    stamp, elapsed = TENTH, 0.0
    for gap in gaps:
        stamp, elapsed = stamp + gap * TENTH, elapsed + gap * 0.1
        distance, turn = deviation(item.follow(stamp, new, moved), new, in_odom)
        left = math.exp(-elapsed / time_constant)
        # Rotating by poses 70 m away and back loses a few of 16 digits.
        assert distance == pytest.approx(left * first, abs=1e-9)
        assert turn == pytest.approx(left * turned, abs=1e-9)


@given(poses, small, poses, st.floats(0.1, 3.0))
def test_follow_converges(old, jump, in_odom, time_constant):
    """Twenty time constants later nothing is left of the jump."""
    item = smoother(time_constant)
    item.follow(TENTH, old, old @ in_odom)
    new = old @ jump
    for count in range(1, 21):
        shown = item.follow(TENTH + int(count * time_constant * 1e9), new, new @ in_odom)
    distance, turn = deviation(shown, new, in_odom)
    assert distance < 1e-6  # 70 m of lever and exp(-20) = 2e-9 of it
    assert abs(turn) < 1e-7


@given(poses, st.lists(small, min_size=2, max_size=10))
def test_follow_of_a_steady_transform_leaves_it(true, way):
    """However the robot moves, where nothing is corrected nothing is shifted."""
    item = smoother(1.0)
    in_odom = Pose2()
    for count, step in enumerate(way, 1):
        in_odom = in_odom @ step
        distance, turn = deviation(item.follow(count * TENTH, true, true @ in_odom), true, in_odom)
        assert distance < 1e-9
        assert abs(turn) < 1e-9


def test_follow_moves_a_robot_far_from_the_origin_of_odom_gently():
    """A turn of map -> odom by 0.1 rad, 1000 m from its origin: the robot turns on the spot.

    Fading the transform itself would swing the robot by a hundred metres on the way.
    """
    item, in_odom = smoother(1.0), Pose2(1000.0, 0.0, 0.0)
    old = Pose2()
    item.follow(TENTH, old, old @ in_odom)
    robot = Pose2(1000.0, 0.0, 0.1)
    new = robot @ in_odom.inverse()
    for count in range(2, 60):
        shown = item.follow(count * TENTH, new, robot) @ in_odom
        assert shown.distance_to(robot) < 1e-9
        assert 0.0 < shown.heading < 0.1


def test_follow_late_stamp_does_not_hurry():
    """Stamps that stand or go back let no time pass."""
    item, old, new = smoother(1.0), Pose2(), Pose2(1.0, 0.0, 0.0)
    item.follow(5 * TENTH, old, old)
    assert item.follow(5 * TENTH, new, new) == old
    assert item.follow(2 * TENTH, new, new) == old
    assert item.follow(15 * TENTH, new, new).x == pytest.approx(1.0 - math.exp(-1.0))


def test_reset_takes_the_next_as_it_is():
    """After a new start there is nothing to fade from."""
    item = smoother(1.0)
    item.follow(TENTH, Pose2(), Pose2())
    item.reset()
    far = Pose2(9.0, 9.0, 3.0)
    assert item.follow(2 * TENTH, far, far) is far
