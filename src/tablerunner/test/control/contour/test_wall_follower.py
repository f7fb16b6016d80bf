"""Going along walls and round corners, at the set distance; a round is noticed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from tablerunner.control.contour import ContourConfig
from tablerunner.control.contour.echo_trail import EchoTrail
from tablerunner.control.contour.round_watch import RoundWatch
from tablerunner.control.contour.wall_follower import LEFT, RIGHT, WallFollower
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments, polygon_edges

CONFIG = ContourConfig()
DT = 0.05
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def along(world, walls, start: Pose2, side: int, wall, steps: int) -> list[Pose2]:
    trail = EchoTrail(world.mounts)
    follower = WallFollower(CONFIG, trail)
    follower.begin(side, wall)
    poses = [start]
    for _ in range(steps):
        pose = poses[-1]
        readings = world.heard(pose, walls)
        trail.hear(readings, pose, DT)
        velocity = follower.step(readings, pose, 0.5)
        assert 0.0 <= velocity.linear_m_s <= CONFIG.speed
        assert abs(velocity.angular_rad_s) <= CONFIG.turn_rate
        poses.append(world.moved(pose, velocity, DT))
    return poses


@pytest.mark.parametrize('side', [LEFT, RIGHT])
@pytest.mark.parametrize(('off', 'heading'), [(0.45, 0.0), (0.8, 0.3), (0.7, -0.4)])
def test_straight_wall_is_followed_at_the_set_distance(world, side, off, heading) -> None:
    """From nearer, farther and askew; the wall is 20 m long and the robot drives 12 m."""
    wall = np.array([[[-2.0, 0.0], [18.0, 0.0]]])
    start = Pose2(0.0, -side * off, side * heading)
    poses = along(world, wall, start, side, (0.0, 0.0), 800)
    beside = [abs(pose.y) - 0.22 for pose in poses[300:]]
    assert beside == pytest.approx([CONFIG.distance] * len(beside), abs=0.03)
    assert poses[-1].x > 9.0


@pytest.mark.parametrize('side', [LEFT, RIGHT])
def test_pillar_is_rounded_and_the_round_noticed(world, side) -> None:
    """Outer corners; the round is 8 m of faces and a circle of 0.57 m radius."""
    walls = polygon_edges(SQUARE)
    start = Pose2(1.0, -0.57, 0.0 if side == LEFT else math.pi)
    poses = along(world, walls, start, side, (1.0, 0.0), 1500)
    places = np.array([(pose.x, pose.y) for pose in poses])
    gaps = distance_to_segments(places, walls).min(axis=1) - 0.25
    assert gaps.min() > 0.2
    assert gaps.max() < 0.5
    watch, way = RoundWatch(CONFIG.shortest_round), 0.0
    for before, pose in itertools.pairwise(poses):
        way += before.distance_to(pose)
        if watch.step(pose):
            break
    round_m = 8.0 + math.tau * 0.57
    assert 0.95 * round_m < way < 1.15 * round_m


@pytest.mark.parametrize('side', [LEFT, RIGHT])
def test_inner_corners_are_turned_in(world, side) -> None:
    """Inside a room of 4 m: all round, never nearer than half the set distance."""
    walls = polygon_edges(2.0 * SQUARE)
    start = Pose2(2.0, 0.57, math.pi if side == LEFT else 0.0)
    poses = along(world, walls, start, side, (2.0, 0.0), 2000)
    places = np.array([(pose.x, pose.y) for pose in poses])
    assert distance_to_segments(places, walls).min() - 0.25 > 0.15
    for corner in 2.0 * SQUARE:
        assert np.hypot(*(places - corner).T).min() < 1.2
    watch = RoundWatch(CONFIG.shortest_round)
    assert any(watch.step(pose) for pose in poses)


@pytest.mark.parametrize('side', [LEFT, RIGHT])
@pytest.mark.parametrize(('off', 'least'), [(0.42, 0.2), (0.3, 0.06), (0.1, 0.02)])
def test_keeps_off_what_stands_across_the_passage(world, side, off, least) -> None:
    """A post `off` beside its way would be 0.17 or 0.05 m from the hull, or hit it."""
    post = np.array([[3.0, -off], [3.1, -off], [3.1, -off - 0.1], [3.0, -off - 0.1]])
    walls = np.concatenate([[[[-2.0, 0.57], [18.0, 0.57]]], polygon_edges(post)])
    walls[..., 1] *= side
    poses = along(world, walls, Pose2(), side, (0.0, 0.57 * side), 400)
    places = np.array([(pose.x, pose.y) for pose in poses])
    assert distance_to_segments(places, walls).min() - 0.25 > least


def test_way_back_on_the_other_side_of_a_thin_wall_is_no_round() -> None:
    """The same places to 0.2 m, in the other direction."""
    watch = RoundWatch(2.5)
    for x in np.arange(0.0, 6.0, 0.1):
        assert not watch.step(Pose2(x, 0.0, 0.0))
    for x in np.arange(6.0, 0.0, -0.1):
        assert not watch.step(Pose2(x, 0.2, math.pi))
    found = [watch.step(Pose2(x, 0.05, 0.1)) for x in np.arange(0.0, 2.0, 0.1)]
    assert found[-1]
    assert not found[1]  # two places are not enough
