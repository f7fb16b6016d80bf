"""Device clocks against exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from tablerunner.simulation.clock import DeviceClock, wrap_counter

TICKS_PER_SECOND = Fraction(128 * 4992, 10) * 10**6  # 128 x 499.2 MHz
DAY_NS = 86_400_000_000_000


@pytest.mark.parametrize('ppm', [0.0, 20.0])
def test_clock_stays_exact_for_a_day(ppm: float) -> None:
    """After a day in uneven strides the count is within a tick of exact rational arithmetic.

    A count kept as float seconds would be off by some 900 ticks (4 m of range) by then.
    """
    random = np.random.default_rng(4)
    clock = DeviceClock(ppm, 0.0, np.random.default_rng(1))
    rate = TICKS_PER_SECOND * (1 + Fraction(clock.rate_error))
    clock.advance(0)
    start = clock.read(0.0)
    now = 0
    while now < DAY_NS:
        now += int(random.integers(1, DAY_NS // 500))
        clock.advance(now)
    counted = clock.read(0.0) - start
    # Each advance rounds its seconds to a float of 53 bits: 500 strides of minutes.
    assert abs(counted - rate * now / 10**9) < 60


def test_clock_when_is_the_inverse_of_read() -> None:
    clock = DeviceClock(20.0, 0.0, np.random.default_rng(2))
    clock.advance(5_000_000_000)
    for offset in (0.0, 1e-9, 1.234e-3, 0.02):
        assert clock.when(clock.read(offset)) == pytest.approx(offset, abs=0.51 / 63.8976e9)


def test_clock_rate_errors_spread_as_configured_and_walk() -> None:
    """Over 400 clocks: the configured ppm at the start, root of the sum of squares after 100 s."""
    first, last = [], []
    for seed in range(400):
        clock = DeviceClock(5.0, 0.5, np.random.default_rng(seed))
        first.append(clock.rate_error * 1e6)
        for second in range(0, 101, 10):
            clock.advance(second * 1_000_000_000)
        last.append(clock.rate_error * 1e6)
    assert np.std(first) == pytest.approx(5.0, rel=0.15)
    assert np.std(last) == pytest.approx(np.hypot(5.0, 0.5 * 10.0), rel=0.15)


def test_clocks_of_different_devices_share_no_zero() -> None:
    starts = {DeviceClock(0.0, 0.0, np.random.default_rng(seed)).read(0.0) for seed in range(50)}
    assert len(starts) == 50
    assert max(starts) - min(starts) > 1 << 39


def test_wrap_counter_keeps_forty_bits() -> None:
    assert wrap_counter((1 << 40) + 7) == 7
    assert wrap_counter((1 << 40) - 1) == (1 << 40) - 1
