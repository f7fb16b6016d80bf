"""What ends a drive, what a contour is left for, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import VelocityLimits
from tablerunner.control.contour import ContourConfig, ContourNavigator, Mode
from tablerunner.control.fuzzy import ReactiveConfig, ReactiveController, Readings
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

INF = math.inf
FREE = Readings((INF,) * 5)
DT = 0.05


def navigator(world, **settings) -> ContourNavigator:
    reactive = ReactiveController(ReactiveConfig(), VelocityLimits())
    return ContourNavigator(ContourConfig(**settings), reactive, world.mounts)


def drive(world, robot, walls, pose, steps):
    """Return all poses and steps until the drive ends."""
    poses, done = [pose], []
    for _ in range(steps):
        step = robot.step(world.heard(poses[-1], walls), poses[-1], DT)
        done.append(step)
        if step.mode in (Mode.ARRIVED, Mode.UNREACHABLE):
            return poses, done
        poses.append(world.moved(poses[-1], step.velocity, DT))
    raise AssertionError(f'the drive does not end: {done[-1]}')


def test_arrives_where_nothing_is_and_stays(world) -> None:
    robot = navigator(world)
    robot.go((3.0, 1.0))
    nowhere = np.array([[[50.0, 50.0], [51.0, 50.0]]])
    poses, steps = drive(world, robot, nowhere, Pose2(0.0, 0.0, 2.0), 600)
    assert steps[-1].mode is Mode.ARRIVED
    assert all(step.mode is Mode.APPROACH for step in steps[:-1])
    assert poses[-1].distance_to(Pose2(3.0, 1.0)) <= robot.config.position_tolerance
    assert robot.step(FREE, Pose2(), DT).velocity == Velocity()  # until there is a new target


def test_wall_across_is_followed_and_left_as_soon_as_the_way_is_free(world) -> None:
    """Beyond its end: from there on the way is the straight line but for the standing radius."""
    robot = navigator(world)
    robot.go((6.0, 0.0))
    wall = np.array([[[3.0, -0.9], [3.0, 0.9]]])
    poses, steps = drive(world, robot, wall, Pose2(), 2000)
    assert steps[-1].mode is Mode.ARRIVED
    left = max(i for i, step in enumerate(steps) if step.mode is Mode.CONTOUR) + 1
    end = math.copysign(0.9, poses[left].y)
    assert poses[left].distance_to(Pose2(3.0, end)) < 1.2
    way = sum(a.distance_to(b) for a, b in zip(poses[left:], poses[left + 1 :], strict=False))
    assert way < 1.1 * poses[left].distance_to(Pose2(6.0, 0.0))
    assert min(pose.distance_to(Pose2(3.0, end)) for pose in poses) > 0.3


def test_limits_hold_in_every_mode(world) -> None:
    reactive = ReactiveController(
        ReactiveConfig(min_speed=0.05), VelocityLimits(max_speed=0.15, max_turn_rate=0.4)
    )
    robot = ContourNavigator(ContourConfig(), reactive, world.mounts)
    robot.go((6.0, 0.0))
    _, steps = drive(world, robot, np.array([[[3.0, -0.9], [3.0, 3.0]]]), Pose2(), 4000)
    assert {step.mode for step in steps} == {Mode.APPROACH, Mode.CONTOUR, Mode.ARRIVED}
    assert all(0.0 <= step.velocity.linear_m_s <= 0.15 for step in steps)
    assert all(abs(step.velocity.angular_rad_s) <= 0.4 for step in steps)


def test_robot_that_cannot_move_gives_up(world) -> None:
    """Something holds it: after `stuck_after`, whatever it commands."""
    robot = navigator(world, stuck_after=3.0)
    robot.go((5.0, 0.0))
    steps = [robot.step(FREE, Pose2(), DT) for _ in range(70)]
    assert steps[50].mode is Mode.APPROACH
    assert steps[-1].mode is Mode.UNREACHABLE
    assert 'stands still' in steps[-1].reason
    assert steps[-1].velocity == Velocity()
    robot.go((5.0, 0.0))
    assert robot.step(FREE, Pose2(), DT).mode is Mode.APPROACH


def test_longest_way_ends_a_drive(world) -> None:
    """Here the target recedes: the pose is not where the robot drives."""
    robot = navigator(world, longest_way=5.0)
    robot.go((100.0, 0.0))
    modes = [robot.step(FREE, Pose2(0.0, 0.02 * i, 0.0), DT).mode for i in range(300)]
    assert modes.index(Mode.UNREACHABLE) == pytest.approx(251, abs=2)


def test_robot_on_a_contour_stands_while_a_sensor_is_silent(world) -> None:
    robot = navigator(world)
    robot.go((6.0, 0.0))
    ahead = Readings((INF, INF, 0.4, INF, INF))
    for _ in range(3):
        step = robot.step(ahead, Pose2(), DT)
    assert step.mode is Mode.CONTOUR
    assert step.velocity.angular_rad_s != 0.0
    for sensor in range(5):
        ages = [0.0] * 5
        ages[sensor] = 0.6
        step = robot.step(Readings(ahead.distances_m, tuple(ages)), Pose2(), DT)
        assert step.mode is Mode.CONTOUR
        assert step.velocity == Velocity()
        assert not step.is_free


def test_wall_aside_is_kept_on_its_side(world) -> None:
    for sensor, side in ((1, 1), (3, -1)):
        robot = navigator(world)
        robot.go((6.0, 0.0))
        heard = [INF] * 5
        heard[sensor] = 0.15
        step = robot.step(Readings(tuple(heard)), Pose2(), DT)
        assert (step.mode, step.side) == (Mode.CONTOUR, side)


def test_hull_strip_right_ahead_counts_wherever_the_target_is(world) -> None:
    """A corner that the hull would graze, 0.27 m aside, while the target is 0.7 rad off."""
    robot = navigator(world)
    robot.go((4.6, 3.9))
    heard = Readings((INF, INF, INF, 0.2, INF))
    step = robot.step(heard, Pose2(), DT)
    assert (step.mode, step.side) == (Mode.CONTOUR, -1)


def test_beyond_a_wall_that_is_followed_the_target_direction_is_not_free(world) -> None:
    """Although no sensor hears anything there: the wall goes on."""
    for north, is_free in ((2.0, False), (-2.0, True)):
        robot = navigator(world)
        robot.go((0.0, 0.0))
        robot.step(Readings((INF, 0.15, INF, INF, INF)), Pose2(-9.0, -north, 0.0), DT)
        for x in np.arange(-7.0, -5.0, 0.02):  # the wall on the left, 0.57 m away
            heard = Readings((0.35, INF, INF, INF, INF))
            step = robot.step(heard, Pose2(x, -north, 0.0), DT)
            if step.is_free:
                break
        assert step.is_free is is_free


def test_wall_met_again_on_the_same_face_is_taken_the_other_way(world) -> None:
    ahead = Readings((INF, INF, 0.3, INF, INF))
    for back, expected in ((Pose2(0.0, 0.3, 0.0), -1), (Pose2(0.0, 4.0, 0.0), 1)):
        robot = navigator(world)
        robot.go((9.0, 0.0))
        first = robot.step(ahead, Pose2(), DT)
        assert (first.mode, first.side) == (Mode.CONTOUR, 1)
        for _ in range(80):  # the echo is forgotten, the target direction free
            step = robot.step(FREE, Pose2(0.0, -2.5, 0.27), DT)
        assert step.mode is Mode.APPROACH
        again = robot.step(ahead, back, DT)
        assert (again.mode, again.side) == (Mode.CONTOUR, expected)


def test_unusable_input_is_refused(world) -> None:
    robot = navigator(world)
    with pytest.raises(ValueError, match='no target'):
        robot.step(FREE, Pose2(), DT)
    with pytest.raises(ValueError, match='target must be finite'):
        robot.go((math.nan, 0.0))
    robot.go((1.0, 0.0))
    with pytest.raises(ValueError, match='pose is not finite'):
        robot.step(FREE, Pose2(math.inf, 0.0, 0.0), DT)
    with pytest.raises(ConfigError, match="leave: got 'never', expected one of free, nearer"):
        ContourConfig(leave='never')
    with pytest.raises(ConfigError, match=r'look: got 0\.5, expected at least notice'):
        ContourConfig(look=0.5)
    with pytest.raises(ConfigError, match='shortest_round'):
        ContourConfig(shortest_round=0.9)
