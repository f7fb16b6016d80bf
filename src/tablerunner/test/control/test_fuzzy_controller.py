"""The fuzzy controller keeps to a path, goes round what stands in it, and never hurries."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import Path, VelocityLimits, sensor_mounts
from tablerunner.control.controller import Controller
from tablerunner.control.fuzzy import SENSORS, Readings, UltrasonicRing
from tablerunner.control.fuzzy_controller import FuzzyController
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Box, RobotGeometry, Scenario, Wall
from tablerunner.simulation.sonar import Sonar
from tablerunner.types import NANOSECONDS, Velocity, nanoseconds

ROBOT = RobotGeometry()
LIMITS = VelocityLimits()
ROOM = Wall(((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)), 'room', True)
PATH = Path(np.array([[1.0, 1.5], [5.5, 1.5], [6.5, 2.5], [6.5, 5.0]]), math.pi / 2)
DT = 0.06


def make() -> FuzzyController:
    mounts = sensor_mounts(ROBOT)
    return FuzzyController(
        LIMITS, tuple(mounts[f'ultrasonic_{name}'] for name in SENSORS), ROBOT.track
    )


def drive(things: tuple, limit_s: float = 150.0, path: Path = PATH):
    """Return poses, drives, gap and controller after following a path in a room with things."""
    scenario = Scenario(name='room', walls=(ROOM,), boxes=things, start=(1.0, 1.5, 0.0))
    sonar = Sonar(scenario, np.random.default_rng(3))
    controller, ring, now = make(), UltrasonicRing(), NANOSECONDS
    controller.follow(path)
    poses, drives = [scenario.start_pose], []
    for number in range(round(2 * limit_s / DT)):
        ring.add(sonar.fire(now, poses[-1], ()), now)
        now += nanoseconds(DT / 2)
        if number % 2:
            controller.hear(ring.readings(now))
            step = controller.step(poses[-1], DT)
            drives.append(step)
            if step.arrived:
                break
            turn = step.velocity.angular_rad_s * DT
            way = step.velocity.linear_m_s * DT
            half = Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)
            poses.append(poses[-1] @ half)
    places = np.array([(pose.x, pose.y) for pose in poses])
    gap = distance_to_segments(places, scenario.obstacle_segments()).min() - 0.25
    return poses, drives, gap, controller


def test_free_path_is_kept_to_its_end_and_heading() -> None:
    poses, drives, _, _ = drive(())
    assert drives[-1].arrived
    assert poses[-1].distance_to(Pose2(*PATH.end)) <= 0.24  # twice the tolerance, turning
    assert abs(difference(poses[-1].heading, PATH.heading)) <= 0.12
    assert max(PATH.project(pose.x, pose.y)[1] for pose in poses) < 0.15  # sharp corners
    assert drives[0].distance_left == pytest.approx(PATH.length, abs=0.1)


@pytest.mark.parametrize('x', [3.0, 4.0])
@pytest.mark.parametrize('aside', [-0.1, 0.0, 0.1])
def test_box_in_the_path_is_gone_round(x: float, aside: float) -> None:
    _, drives, gap, _ = drive((Box('box', x, 1.5 + aside, 0.6, 0.6),))
    assert drives[-1].arrived
    assert gap > 0.05
    assert drives[-1].cross_track < 0.25
    assert max(step.cross_track for step in drives) > 0.3  # it was in the path


def test_path_is_taken_up_again_where_it_is_met() -> None:
    """Out and back 0.8 m apart; the way round the box cuts the far end off."""
    path = Path(np.array([[1.0, 1.5], [3.0, 1.5], [3.0, 2.3], [1.0, 2.3]]))
    poses, drives, gap, _ = drive((Box('box', 2.7, 1.5, 0.6, 0.6),), 40.0, path)
    assert drives[-1].arrived
    assert gap > 0.05
    back = next(i for i, pose in enumerate(poses) if pose.y > 2.2)
    assert min(pose.y for pose in poses[back:]) > 2.0


def test_box_beside_the_path_is_passed_on_the_path() -> None:
    """0.12 m between hull and box, the planner's clearance."""
    poses, drives, gap, _ = drive((Box('box', 3.5, 1.5 + 0.37 + 0.3, 0.6, 0.6),))
    assert drives[-1].arrived
    assert max(PATH.project(pose.x, pose.y)[1] for pose in poses) < 0.15
    assert gap > 0.05


@pytest.mark.parametrize(('heading', 'leaves'), [(0.0, True), (0.35, False), (-0.35, False)])
def test_echo_counts_when_it_is_in_the_path_wherever_in_the_cone(heading, leaves) -> None:
    """0.92 m away; turned by 0.35 rad, one end of the arc is 0.1 m from the path, one 0.5 m."""
    heard = Readings((math.inf, math.inf, 0.7, math.inf, math.inf))
    with_echo, without = make(), make()
    for controller in (with_echo, without):
        controller.follow(PATH)
    pose = Pose2(2.0, 1.5, heading)
    same = True
    for _ in range(30):  # until it would be faster than it may be 0.7 m before something
        with_echo.hear(heard)
        same = same and with_echo.step(pose, DT).velocity == without.step(pose, DT).velocity
    assert same is not leaves


def test_closed_passage_is_told_and_the_robot_stands() -> None:
    """Boxes across the room, hardly less than its width."""
    across = (Box('box', 3.5, 3.0, 0.3, 5.96),)
    _, drives, gap, controller = drive(across, 200.0)
    assert not drives[-1].arrived
    assert controller.blocked_by == 'went round without a way out'
    assert drives[-1].velocity == Velocity()
    assert gap > 0.02


def test_accelerations_are_kept() -> None:
    _, drives, _, _ = drive((Box('box', 3.0, 1.5, 0.6, 0.6),))
    last = Velocity()
    for step in drives:
        gain = step.velocity.linear_m_s - last.linear_m_s
        assert -LIMITS.max_deceleration * DT - 1e-9 <= gain <= LIMITS.max_acceleration * DT + 1e-9
        change = abs(step.velocity.angular_rad_s - last.angular_rad_s)
        assert change <= LIMITS.max_turn_acceleration * DT + 1e-9
        last = step.velocity


def test_halts_and_refuses_what_cannot_be() -> None:
    controller: Controller = make()
    with pytest.raises(ValueError, match='no path'):
        controller.step(Pose2(), DT)
    controller.follow(PATH)
    with pytest.raises(ValueError, match='not finite'):
        controller.step(Pose2(math.nan, 0.0, 0.0), DT)
    for _ in range(20):
        controller.step(Pose2(1.0, 1.5, 0.0), DT)
    speeds = [controller.halt(DT).linear_m_s for _ in range(20)]
    assert speeds[0] > 0.0
    assert speeds[-1] == 0.0
    point = Path(np.array([[1.0, 1.5]]), 1.0)
    controller.follow(point)
    drives = [controller.step(Pose2(1.0, 1.5, 0.0), DT) for _ in range(3)]
    assert drives[-1].velocity.angular_rad_s > 0.0  # turns to the heading
    assert controller.step(Pose2(1.0, 1.5, 1.0), DT).arrived


@pytest.mark.parametrize('bearing', [-2.0, -1.4, 1.4, 3.1])
def test_path_that_leads_aside_is_turned_to_first(bearing: float) -> None:
    """Driving while it turns would swing the robot out beside its path, by up to 0.3 m."""
    controller, pose = make(), Pose2(0.0, 0.0, bearing)
    controller.follow(Path(np.array([[0.0, 0.0], [0.6, 0.0]])))
    late, offs = [Velocity()], []  # the base is a step behind
    for _ in range(200):
        controller.hear(Readings((math.inf,) * 5))
        step = controller.step(pose, 0.05)
        offs.append(step.cross_track)
        if step.arrived:
            break
        late.append(step.velocity)
        velocity = late.pop(0)
        turn = 0.05 * velocity.angular_rad_s
        way = 0.05 * velocity.linear_m_s
        pose = pose @ Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)
    assert step.arrived
    assert max(offs) < 0.1


@pytest.mark.parametrize(
    ('heard', 'sign'),
    [
        ((math.inf, 0.2, math.inf, math.inf, math.inf), -1),
        ((0.1, math.inf, math.inf, math.inf, math.inf), -1),
        ((math.inf, math.inf, math.inf, 0.2, math.inf), 1),
        ((math.inf, math.inf, math.inf, math.inf, 0.1), 1),
        ((0.15, 0.2, math.inf, 0.2, 0.15), 0),
        ((0.4, 0.4, math.inf, 0.5, 0.4), 0),
    ],
)
def test_turns_away_from_what_is_near_on_one_side(heard, sign) -> None:
    """On the path and along it, so that there is no other reason to turn."""
    controller = make()
    controller.follow(PATH)
    for _ in range(10):
        controller.hear(Readings(heard))
        velocity = controller.step(Pose2(2.0, 1.5, 0.0), DT).velocity
    assert np.sign(round(velocity.angular_rad_s, 6)) == sign
    assert velocity.linear_m_s > 0.1
