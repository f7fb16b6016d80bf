"""The delay of the IMU's stamps is found from turns, and not invented without them."""

import math

import numpy as np
import pytest

from tablerunner.odometry.clock_offset import ClockOffset


def rate(t):
    """Return the turn rate of a robot that turns one way and the other, by smooth ramps."""
    return 0.9 * math.sin(0.8 * t) * (1.0 + math.sin(0.31 * t)) / 2.0


def fed(delay_s, seed, seconds=60.0, scale=1.01):
    """Return the offset after a drive whose gyro stamps are late by `delay_s`."""
    rng = np.random.default_rng(seed)
    offset = ClockOffset()
    for k in range(int(seconds * 50)):
        t = 0.02 * k
        wheels = scale * rate(t) + 0.027 * rng.choice([-0.5, 0.0, 0.5])
        gyro = rate(t - delay_s) + rng.normal(0.0, 0.005)
        offset.add(wheels * 0.02, gyro * 0.02, 0.02)
    return offset


@pytest.mark.parametrize('delay_s', [-0.05, -0.02, 0.0, 0.03, 0.05])
def test_delay_is_found_within_its_deviation(delay_s):
    """Within 3 ms over ten drives, with encoder steps, gyro noise and a track error."""
    found = [fed(delay_s, seed) for seed in range(10)]
    assert np.mean([offset.delay_s for offset in found]) == pytest.approx(delay_s, abs=0.003)
    assert all(abs(offset.delay_s - delay_s) < 0.006 for offset in found)
    assert all(offset.deviation_s < 0.003 for offset in found)


def test_delay_without_turns_stays_unknown():
    """Straight on, nothing tells of the delay."""
    offset = ClockOffset()
    for _ in range(1000):
        offset.add(0.0, 0.0001, 0.02)
    assert (offset.delay_s, offset.deviation_s) == (0.0, math.inf)
