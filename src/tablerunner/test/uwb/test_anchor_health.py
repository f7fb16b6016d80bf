"""How well each anchor serves."""

import math

import pytest

from tablerunner.types import LosState, RangeSample
from tablerunner.uwb import AnchorHealthConfig, AnchorWatch
from tablerunner.uwb.positioner import FixDetail

NAMES = ('A', 'B')
START = 10**12


def watch_of(**settings):
    return AnchorWatch(AnchorHealthConfig(**settings), NAMES)


def drive(watch, seconds, lost=(), blocked=(), start=START, rounds_hz=10):
    """Go round both anchors: `lost` and `blocked` name anchors of which every second one is."""
    for index in range(seconds * rounds_hz):
        for place, name in enumerate(NAMES):
            if name in lost and index % 2:
                continue
            state = LosState.NLOS if name in blocked and index % 2 else LosState.LOS
            watch.add_range(
                RangeSample(
                    start + index * (10**9 // rounds_hz) + place * 10**7,
                    name,
                    'tag',
                    2 * index + place,
                    5.0,
                    los=state,
                )
            )


def test_rate_loss_and_nlos_share_of_each_anchor():
    watch = watch_of()
    drive(watch, 10, lost=('B',), blocked=('A',))
    a, b = watch.health('A'), watch.health('B')
    assert a.rate_hz == pytest.approx(10.0, rel=0.02)
    assert b.rate_hz == pytest.approx(5.0, rel=0.03)
    assert (a.loss, b.loss) == pytest.approx((0.0, 0.5), abs=0.02)
    assert (a.nlos_share, b.nlos_share) == pytest.approx((0.5, 0.0))


def test_only_the_window_counts():
    """Ten bad seconds are forgotten after ten good ones; silence brings the rate down."""
    watch = watch_of(health_window=5.0)
    drive(watch, 10, blocked=('A',))
    drive(watch, 10, start=START + 10 * 10**9)
    assert watch.health('A').nlos_share == 0.0
    silent = watch_of(health_window=5.0)
    drive(silent, 10)
    for index in range(60):
        stamp = START + 10 * 10**9 + index * 10**8
        silent.add_range(RangeSample(stamp, 'A', 'tag', 200 + index, 5.0))
    assert silent.health('B').rate_hz == 0.0
    assert silent.health('B').loss == 1.0


def test_residual_is_the_mean_over_fixes():
    watch = watch_of()
    drive(watch, 1)
    for index in range(10):
        watch.add_fix(FixDetail(START + index, 1.0, {'A': 0.2 + 0.02 * index, 'C': 9.0}, NAMES))
    assert watch.health('A').residual_m == pytest.approx(0.29)
    assert math.isnan(watch.health('B').residual_m)


def test_device_that_does_not_count_has_unknown_loss():
    watch = watch_of()
    for index in range(20):
        watch.add_range(RangeSample(START + index * 10**8, 'A', 'tag', 0, 5.0))
    assert math.isnan(watch.health('A').loss)


def test_too_few_samples_say_nothing():
    watch = watch_of()
    watch.add_range(RangeSample(START, 'A', 'tag', 0, 5.0, los=LosState.NLOS))
    assert math.isnan(watch.health('A').nlos_share)
    assert watch.health('A').faults(watch.config) == ()


def test_jump_back_in_time_begins_anew():
    watch = watch_of()
    drive(watch, 10, blocked=('A',))
    drive(watch, 2, start=START - 100 * 10**9)
    assert watch.health('A').nlos_share == 0.0
    assert watch.health('A').rate_hz == pytest.approx(10.0, rel=0.1)


def test_unknown_anchor_is_left_out():
    watch = watch_of()
    watch.add_range(RangeSample(START, 'Z', 'tag', 0, 5.0))
    assert watch.health('A').rate_hz == 0.0


def test_faults_are_told_by_the_limits():
    watch = watch_of(worst_loss=0.4, worst_nlos=0.4, worst_bias=0.1)
    drive(watch, 10, lost=('B',), blocked=('A',))
    for index in range(10):
        watch.add_fix(FixDetail(START + index, 1.0, {'A': -0.2}, NAMES))
    assert watch.health('A').faults(watch.config) == (
        '50% of its ranges NLOS',
        'its ranges -0.20 m off the fix',
    )
    assert watch.health('B').faults(watch.config) == ('50% of its exchanges lost',)


def test_device_that_counts_rounds_loses_what_is_missing_in_them():
    """One number for both anchors: all of A's ranges are there, every second of B's is not."""
    watch = AnchorWatch(AnchorHealthConfig(), NAMES, at_once=True)
    for index in range(100):
        for name in NAMES if index % 2 else NAMES[:1]:
            watch.add_range(RangeSample(START + index * 10**8, name, 'tag', index, 5.0))
    assert (watch.health('A').loss, watch.health('B').loss) == pytest.approx((0.0, 0.5), abs=0.02)
