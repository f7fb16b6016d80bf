"""The start from poses: a few that agree with each other and with odometry, and no fewer."""

import math

import numpy as np
import pytest

from tablerunner.estimation.alignment import AlignmentConfig
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.pose_start import NO_HEADING, OVERTAKEN, PoseStart
from tablerunner.estimation.track import OdometryTrack
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import NANOSECONDS, OdometrySample, PoseSample, Refusal

STD = (0.007, 0.007, 0.01)
BEGIN = Pose2(4.0, 3.0, 0.8)


def finder(**settings):
    return PoseStart(AlignmentConfig(**settings), EstimatorConfig())


def track(speed=0.5, turn_rate=0.3, seconds=10.0):
    """Return odometry at 50 Hz along a curve, from the origin of odom."""
    found = OdometryTrack()
    for k in range(round(seconds * 50) + 1):
        t = k * 0.02
        h = turn_rate * t
        x, y = speed * math.sin(h) / turn_rate, speed * (1.0 - math.cos(h)) / turn_rate
        stamp = NANOSECONDS + k * 20_000_000
        found.add(OdometrySample(stamp, Pose2(x, y, h), speed, turn_rate))
    return found


def pose(odometry, t, std=STD, off=(0.0, 0.0, 0.0)):
    """Return the true pose at a time [s], off by something [m, m, rad]."""
    stamp = NANOSECONDS + round(t * NANOSECONDS)
    at = BEGIN @ odometry.pose(stamp)
    moved = Pose2(at.x + off[0], at.y + off[1], wrap(at.heading + off[2]))
    return PoseSample(stamp, moved, np.diag(np.square(std)), 'camera/pose')


def kinds(found):
    return [type(item) for item in found]


def test_third_pose_that_agrees_starts_where_the_robot_is_then():
    """Noise as told, many seeds: the start has no more error than it says (chi-square)."""
    odometry, total, seeds = track(), 0.0, 40
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        start = finder()
        found = [
            start.add(pose(odometry, 0.1 * k, off=rng.normal(0.0, STD)), odometry)
            for k in range(3)
        ]
        assert kinds(found) == [type(None), type(None), Start]
        truth = pose(odometry, 0.2)
        assert found[2].stamp == truth.stamp
        error = found[2].pose - (truth.pose.x, truth.pose.y, truth.pose.heading)
        total += error @ np.linalg.solve(found[2].pose_covariance, error)
    # 120 degrees of freedom: 99.9 % between 76 and 174.
    assert 76 < total < 174


@pytest.mark.parametrize('at', [0, 1, 2])
def test_one_false_marker_starts_nothing(at):
    """A pose elsewhere in the room: what counts is three good ones in a row."""
    odometry, start = track(), finder()
    found = []
    for k in range(6):
        off = (2.0, -1.0, 0.5) if k == at else (0.0, 0.0, 0.0)
        found.append(start.add(pose(odometry, 0.1 * k, off=off), odometry))
    first = next(k for k, item in enumerate(found) if isinstance(item, Start))
    assert first == at + 3
    truth = pose(odometry, 0.1 * first).pose
    assert found[first].pose[:2] == pytest.approx([truth.x, truth.y], abs=1e-3)


def test_marker_that_stands_while_the_robot_drives_starts_nothing():
    odometry, start = track(speed=0.3), finder()
    fixed = pose(odometry, 0.0)
    for k in range(60):
        stamp = fixed.stamp + k * NANOSECONDS // 10
        sample = PoseSample(stamp, fixed.pose, fixed.covariance, fixed.source)
        assert start.add(sample, odometry) is None


def test_heading_that_is_turned_round_starts_nothing():
    """The course of a robot that backs up points the other way: odometry tells."""
    odometry, start = track(speed=-0.5), finder()
    for k in range(60):
        sample = pose(odometry, 0.1 * k, off=(0.0, 0.0, math.pi))
        assert start.add(sample, odometry) is None


def test_headings_that_say_little_are_gathered():
    """Courses of a single disc, known to 0.2 rad: it takes the poses that it takes."""
    odometry, start = track(), finder(max_heading_std=0.05)
    rng = np.random.default_rng(1)
    std, taken = (0.005, 0.005, 0.2), 0
    found = None
    while found is None:
        sample = pose(odometry, 0.1 * taken, std, rng.normal(0.0, std))
        found = start.add(sample, odometry)
        taken += 1
        if found is None and taken >= 3:
            assert start.words == 'heading unknown: drive'
    assert isinstance(found, Start)
    assert 3 < taken < 15  # way and places tell the heading sooner than sixteen courses would
    assert math.sqrt(found.pose_covariance[2, 2]) <= 0.05
    assert abs(wrap(found.pose[2] - pose(odometry, 0.1 * (taken - 1)).pose.heading)) < 0.15


def test_places_that_are_known_badly_start_nothing():
    odometry, start = track(), finder()
    std = (2.0, 2.0, 0.01)
    for k in range(5):
        assert start.add(pose(odometry, 0.1 * k, std), odometry) is None
    assert 'position known to' in start.words


def test_poses_too_far_apart_do_not_count_together():
    odometry, start = track(), finder()
    for k in range(4):
        sample = pose(odometry, 2.1 * k)
        assert start.add(sample, odometry) is None
        assert start.words == '1 of 3 poses that agree'


def test_what_is_of_no_use_is_refused_with_a_reason():
    odometry, start = track(), finder()
    place = pose(odometry, 0.0, (0.01, 0.01, math.inf))
    assert start.add(place, odometry) == Refusal(place.stamp, 'camera/pose', '', NO_HEADING)
    assert start.add(pose(odometry, 0.2), odometry) is None
    assert start.add(pose(odometry, 0.1), odometry).reason == OVERTAKEN
    assert start.add(pose(odometry, 0.2), odometry).reason == OVERTAKEN
    # A place between two poses counts with them.
    assert start.add(pose(odometry, 0.3, (0.01, 0.01, math.inf)), odometry) is None
    assert isinstance(start.add(pose(odometry, 0.4), odometry), Start)
