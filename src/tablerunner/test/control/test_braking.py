from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.control import largest_speed, stopping_distance

delays = st.floats(0.0, 1.0)
decelerations = st.floats(0.2, 3.0)
approaches = st.floats(0.0, 1.5)


@given(st.floats(0.0, 2.0), delays, decelerations, approaches)
def test_largest_speed_is_the_inverse_of_stopping_distance(
    speed: float, delay: float, deceleration: float, approach: float
) -> None:
    """A robot that may use exactly its stopping distance may keep its speed."""
    way = stopping_distance(speed, delay, deceleration, approach)
    found = float(largest_speed(way, delay, deceleration, approach))
    assert found == pytest.approx(speed, abs=1e-6)


@given(st.floats(0.05, 1.0), delays, decelerations, approaches)
def test_stopping_distance_is_that_of_a_simulated_stop(
    speed: float, delay: float, deceleration: float, approach: float
) -> None:
    """Integrated in small steps, the gap closes by what the formula says."""
    dt, time, now, gap = 1e-3, 0.0, speed, 0.0
    while now > 0.0:
        now = speed if time < delay else max(now - deceleration * dt, 0.0)
        gap += (now + approach) * dt
        time += dt
    assert gap == pytest.approx(
        stopping_distance(speed, delay, deceleration, approach), abs=5e-3 * (1 + approach)
    )


def test_stopping_distance_of_the_default_robot_is_known() -> None:
    """0.6 m/s x 0.3 s + (0.6 m/s)^2 / (2 x 0.8 m/s^2), by hand."""
    assert stopping_distance(0.6, 0.3, 0.8) == pytest.approx(0.405)


@given(st.floats(-1.0, 0.0), delays, decelerations, approaches)
def test_largest_speed_without_way_is_zero(
    way: float, delay: float, deceleration: float, approach: float
) -> None:
    assert float(largest_speed(way, delay, deceleration, approach)) == 0.0
