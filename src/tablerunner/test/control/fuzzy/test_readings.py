from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control.fuzzy import Readings, UltrasonicRing
from tablerunner.types import UltrasonicSample

NOW = 10_000_000_000
MS = 1_000_000


def sample(sensor: str, range_m: float, stamp: int = NOW) -> UltrasonicSample:
    return UltrasonicSample(stamp, f'ultrasonic_{sensor}', range_m, 0.03, 3.0, 0.48)


def test_each_reading_keeps_its_age() -> None:
    """Five sensors that fire 30 ms after one another."""
    ring = UltrasonicRing()
    for number, name in enumerate(('left', 'left_front', 'front', 'right_front', 'right')):
        assert ring.add(sample(name, 1.0 + number, NOW + 30 * MS * number), NOW + 200 * MS) is None
    readings = ring.readings(NOW + 120 * MS)
    assert readings.distances_m == (1.0, 2.0, math.inf, math.inf, math.inf)  # 3 m is the reach
    assert readings.ages_s == pytest.approx((0.12, 0.09, 0.06, 0.03, 0.0))


@pytest.mark.parametrize(
    ('given', 'kept'),
    [(1.2, 1.2), (math.inf, math.inf), (3.0, math.inf), (-math.inf, 0.0), (0.01, 0.0)],
)
def test_reading_means_what_rep_117_says(given: float, kept: float) -> None:
    ring = UltrasonicRing()
    assert ring.add(sample('front', given), NOW) is None
    assert ring.readings(NOW).distances_m[2] == kept


@pytest.mark.parametrize(
    ('bad', 'reason'),
    [
        (sample('front', math.nan, NOW + 1), 'range is not a number'),
        (sample('front', 0.0, NOW + 1), 'range is not positive'),
        (sample('front', -1.0, NOW + 1), 'range is not positive'),
        (sample('back', 1.0, NOW + 1), 'unknown sensor'),
        (sample('front', 1.0, 0), 'no stamp'),
        (sample('front', 1.0, NOW), 'stamp not after the last'),
        (sample('front', 1.0, NOW + 200 * MS), 'stamp in the future'),
    ],
)
def test_bad_reading_is_refused_and_leaves_the_last(bad: UltrasonicSample, reason: str) -> None:
    ring = UltrasonicRing()
    ring.add(sample('front', 1.5), NOW)
    refusal = ring.add(bad, NOW)
    assert refusal is not None
    assert refusal.reason == reason
    assert ring.readings(NOW).distances_m[2] == 1.5


def test_old_reading_counts_as_nearer_and_a_stale_one_as_touching() -> None:
    readings = Readings((1.0, 1.0, math.inf, 0.1, math.nan), (0.0, 0.2, 0.5, 0.4, 0.0))
    aged = readings.aged(closing_m_s=0.5, reach_m=3.0, stale_after_s=0.45)
    assert aged == pytest.approx([1.0, 0.9, 0.0, 0.0, 0.0])
    assert readings.stale(0.45) == ('front', 'right')
    assert readings.aged(0.5, 3.0, 0.6)[2] == pytest.approx(2.75)
    assert readings.stale(0.5) == ('right',)  # just as old as that is not stale


def test_age_never_makes_a_distance_longer_than_it_can_be() -> None:
    """A thing that is driven at head-on at no more than the closing speed is never overrated."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        heard, age, speed = rng.uniform(0.0, 3.0), rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.6)
        truth = max(heard - speed * age, 0.0)
        readings = Readings((heard,) * 5, (age,) * 5)
        assert max(readings.aged(0.6, 3.0, 0.5)) <= truth + 1e-12


def test_sensor_that_never_spoke_is_stale() -> None:
    ring = UltrasonicRing()
    readings = ring.readings(NOW)
    assert len(readings.stale(1e9)) == 5
    ring.add(sample('front', 1.0), NOW)
    assert 'front' not in ring.readings(NOW).stale(0.5)
    ring.reset()
    assert 'front' in ring.readings(NOW).stale(0.5)


def test_ring_needs_five_sensors() -> None:
    with pytest.raises(ValueError, match='5 different sensors'):
        UltrasonicRing(('a', 'b'))
    with pytest.raises(ValueError, match='5 different sensors'):
        UltrasonicRing(('a', 'a', 'b', 'c', 'd'))
