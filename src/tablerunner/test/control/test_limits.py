from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.control import VelocityLimits
from tablerunner.errors import ConfigError
from tablerunner.types import Velocity

LIMITS = VelocityLimits()
speeds = st.floats(-5.0, 5.0)


@given(speeds, speeds, speeds, speeds, st.floats(0.0, 0.5))
def test_approach_from_allowed_velocity_keeps_every_limit(
    linear: float, angular: float, to_linear: float, to_angular: float, dt: float
) -> None:
    """Speed, acceleration, deceleration and turn limits hold whatever is asked for."""
    now = LIMITS.clamp(Velocity(linear, angular))
    after = LIMITS.approach(now, Velocity(to_linear, to_angular), dt)
    assert -LIMITS.max_reverse_speed - 1e-9 <= after.linear_m_s <= LIMITS.max_speed + 1e-9
    assert abs(after.angular_rad_s) <= LIMITS.max_turn_rate + 1e-9
    gain = abs(after.linear_m_s) - abs(now.linear_m_s)
    assert -LIMITS.max_deceleration * dt - 1e-9 <= gain <= LIMITS.max_acceleration * dt + 1e-9
    turn = abs(after.angular_rad_s - now.angular_rad_s)
    assert turn <= LIMITS.max_turn_acceleration * dt + 1e-9


@given(speeds, speeds)
def test_clamp_keeps_the_arc(linear: float, angular: float) -> None:
    """Slowing both components alike leaves the curvature as it was asked for."""
    kept = LIMITS.clamp(Velocity(linear, angular))
    assert kept.linear_m_s * angular == pytest.approx(kept.angular_rad_s * linear, abs=1e-9)


@given(speeds, speeds)
def test_approach_repeated_reaches_the_target(linear: float, angular: float) -> None:
    """The ramp ends at the clamped target and does not swing about it."""
    target = LIMITS.clamp(Velocity(linear, angular))
    now = Velocity()
    for _ in range(200):
        now = LIMITS.approach(now, Velocity(linear, angular), 0.05)
    assert now.linear_m_s == pytest.approx(target.linear_m_s)
    assert now.angular_rad_s == pytest.approx(target.angular_rad_s)


def test_approach_through_zero_stands_first() -> None:
    """From forwards to backwards within one step is not allowed."""
    assert LIMITS.approach(Velocity(0.01, 0.0), Velocity(-1.0, 0.0), 0.5).linear_m_s == 0.0


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
def test_clamp_of_infinite_velocity_stands(bad: float) -> None:
    assert LIMITS.clamp(Velocity(bad, 0.0)) == Velocity()
    assert LIMITS.clamp(Velocity(0.3, bad)) == Velocity()


def test_limits_of_zero_speed_are_refused() -> None:
    with pytest.raises(ConfigError, match='max_speed'):
        VelocityLimits(max_speed=0.0)
