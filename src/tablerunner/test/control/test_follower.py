from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.control import FollowerConfig, Path, PurePursuit, VelocityLimits
from tablerunner.errors import ConfigError
from tablerunner.geometry.angles import difference, wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

LIMITS = VelocityLimits()
CONFIG = FollowerConfig()
DT = 0.05


def drive(
    path: Path, start: Pose2, limit_s: float = 90.0, noise: float = 0.0, seed: int = 0
) -> tuple[Pose2, list[float], list[Velocity], bool]:
    """Follow a path with an ideal unicycle; return end, distances from the path, velocities."""
    random = np.random.default_rng(seed)
    follower = PurePursuit(CONFIG, LIMITS)
    follower.follow(path)
    pose, off, velocities = start, [], []
    for _ in range(int(limit_s / DT)):
        seen = Pose2(
            *(np.array([pose.x, pose.y]) + noise * random.standard_normal(2)), pose.heading
        )
        step = follower.step(seen, DT)
        off.append(path.project(pose.x, pose.y)[1])
        velocities.append(step.velocity)
        if step.arrived:
            return pose, off, velocities, True
        turn = step.velocity.angular_rad_s * DT
        way = step.velocity.linear_m_s * DT
        heading = pose.heading + turn / 2
        pose = Pose2(
            pose.x + way * math.cos(heading),
            pose.y + way * math.sin(heading),
            wrap(pose.heading + turn),
        )
    return pose, off, velocities, False


ZIGZAG = Path(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [6.0, 2.5], [4.0, 4.0]]), 1.0)


@settings(max_examples=15, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_follower_from_any_heading_arrives_with_the_heading_asked_for(
    start: float, end: float
) -> None:
    """Whatever way it looks at first, it ends within both tolerances and near the path."""
    path = Path(ZIGZAG.points, end)
    pose, off, _, arrived = drive(path, Pose2(0.0, 0.0, start))
    assert arrived
    assert math.hypot(pose.x - 4.0, pose.y - 4.0) <= 2 * CONFIG.position_tolerance
    assert abs(difference(pose.heading, end)) <= CONFIG.heading_tolerance
    assert max(off) < 0.25


def test_follower_keeps_limits_of_speed_and_acceleration() -> None:
    _, _, velocities, _ = drive(ZIGZAG, Pose2(0.0, 0.0, 2.0))
    linear = np.array([velocity.linear_m_s for velocity in velocities])
    angular = np.array([velocity.angular_rad_s for velocity in velocities])
    assert linear.max() <= LIMITS.max_speed
    assert linear.min() >= 0.0
    assert linear.max() > 0.9 * LIMITS.max_speed
    assert np.abs(angular).max() <= LIMITS.max_turn_rate
    assert np.diff(linear).max() <= LIMITS.max_acceleration * DT + 1e-9
    assert np.diff(linear).min() >= -LIMITS.max_deceleration * DT - 1e-9


@pytest.mark.parametrize('seed', range(8))
def test_follower_with_noisy_pose_arrives(seed: int) -> None:
    """5 cm of white noise on the position is worse than the estimator's error and does no harm."""
    pose, off, _, arrived = drive(ZIGZAG, Pose2(0.0, 0.0, 0.0), noise=0.05, seed=seed)
    assert arrived
    assert math.hypot(pose.x - 4.0, pose.y - 4.0) <= 0.3
    assert max(off) < 0.35


def test_follower_without_heading_asked_for_ends_as_it_comes() -> None:
    path = Path(np.array([[0.0, 0.0], [2.0, 0.0]]))
    pose, _, velocities, arrived = drive(path, Pose2(0.0, 0.0, 0.0))
    assert arrived
    assert abs(pose.heading) < 0.1
    assert velocities[-1].linear_m_s < 0.3


def test_follower_is_deterministic() -> None:
    first = drive(ZIGZAG, Pose2(0.0, 0.0, 1.0), noise=0.03, seed=4)
    second = drive(ZIGZAG, Pose2(0.0, 0.0, 1.0), noise=0.03, seed=4)
    assert first == second


def test_follower_halting_slows_down_within_the_limit() -> None:
    follower = PurePursuit(CONFIG, LIMITS)
    follower.follow(ZIGZAG)
    for _ in range(40):
        step = follower.step(Pose2(0.0, 0.0, 0.0), DT)
    before = step.velocity.linear_m_s
    after = follower.halt(DT).linear_m_s
    assert before - after == pytest.approx(LIMITS.max_deceleration * DT)
    for _ in range(40):
        velocity = follower.halt(DT)
    assert velocity == Velocity()


def test_follower_without_path_or_pose_refuses() -> None:
    follower = PurePursuit(CONFIG, LIMITS)
    with pytest.raises(ValueError, match='no path'):
        follower.step(Pose2(), DT)
    follower.follow(ZIGZAG)
    with pytest.raises(ValueError, match='finite'):
        follower.step(Pose2(math.nan, 0.0, 0.0), DT)


def test_follower_config_upside_down_is_refused() -> None:
    with pytest.raises(ConfigError, match='lookahead_max'):
        FollowerConfig(lookahead_min=0.5, lookahead_max=0.4)
    with pytest.raises(ConfigError, match='turn_until'):
        FollowerConfig(turn_in_place_above=0.3, turn_until=0.4)
