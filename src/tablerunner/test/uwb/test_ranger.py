"""The ranger turns exchanges into ranges and says why it refuses one."""

import math
from dataclasses import replace

import pytest

from tablerunner.errors import ConfigError
from tablerunner.types import ExchangeSample, LosState, RangeSample, Refusal
from tablerunner.uwb import Ranger, RangerConfig

CONFIG = RangerConfig(anchor_ids=('A0', 'A1'), anchor_positions=(0.0, 0.0, 2.0, 5.0, 0.0, 2.0))
TICKS_PER_M = 128 * 499.2e6 / 299_702_547.0
SECOND = 1_000_000_000


def sample(stamp=SECOND, sequence=1, anchor='A0', distance=5.0, gap=3.0):
    flight, reply = round(distance * TICKS_PER_M), 60_000_000
    return ExchangeSample(
        stamp,
        anchor,
        'tag',
        sequence,
        0,
        flight,
        flight + reply,
        2 * flight + reply,
        2 * flight + 2 * reply,
        3 * flight + 2 * reply,
        -80.0,
        -80.0 - gap,
    )


def reason(result):
    assert isinstance(result, Refusal)
    assert (result.source, result.key) == ('uwb/exchanges', result.key)
    return result.reason


def test_add_good_exchange_gives_calibrated_range():
    """The range is calibrated, the raw one kept, the noise the configured one."""
    ranger = Ranger(CONFIG.replace(anchor_biases=(0.3, 0.0), anchor_scales=(0.02, 0.0)))
    result = ranger.add(sample(distance=5.4))
    assert isinstance(result, RangeSample)
    assert result.raw_range_m == pytest.approx(5.4, abs=0.01)
    assert result.range_m == pytest.approx((5.4 - 0.3) / 1.02, abs=0.01)
    assert result.variance_m2 == pytest.approx(CONFIG.range_std**2)


def test_add_weak_first_path_is_marked_nlos():
    """The power gap decides between LOS, NLOS and unknown."""
    ranger = Ranger(CONFIG)
    clear = ranger.add(sample(sequence=1))
    blocked = ranger.add(sample(stamp=2 * SECOND, sequence=2, gap=15.0))
    silent = ranger.add(replace(sample(stamp=3 * SECOND, sequence=3), rx_power_dbm=math.nan))
    assert [item.los for item in (clear, blocked, silent)] == [
        LosState.LOS,
        LosState.NLOS,
        LosState.UNKNOWN,
    ]


@pytest.mark.parametrize(
    ('bad', 'words'),
    [
        (sample(stamp=0, sequence=9), 'zero stamp'),
        (sample(stamp=2 * SECOND, sequence=1), 'repeated sequence number'),
        (sample(stamp=SECOND, sequence=2), 'stamp does not advance'),
        (sample(stamp=2 * SECOND, sequence=2, anchor='A9'), 'unknown anchor'),
        (sample(stamp=2 * SECOND, sequence=2, distance=-3.0), 'negative range'),
        (sample(stamp=2 * SECOND, sequence=2, distance=80.0), 'range beyond max_range'),
        (replace(sample(2 * SECOND, 2), final_tx=5), 'impossible exchange times'),
    ],
)
def test_add_bad_exchange_is_refused_with_reason(bad, words):
    """Each fault has its own words, and the next good exchange is taken."""
    ranger = Ranger(CONFIG)
    assert isinstance(ranger.add(sample()), RangeSample)
    assert reason(ranger.add(bad)) == words
    assert isinstance(ranger.add(sample(stamp=3 * SECOND, sequence=3)), RangeSample)


def test_add_stream_started_again_is_taken_up():
    """After a restart from an earlier time, ranging goes on from the third exchange."""
    ranger = Ranger(CONFIG)
    ranger.add(sample(stamp=100 * SECOND, sequence=500))
    results = [ranger.add(sample(stamp=k * SECOND, sequence=k)) for k in (1, 2, 3, 4)]
    assert [isinstance(item, RangeSample) for item in results] == [False, False, True, True]


@pytest.mark.parametrize(
    ('changes', 'field'),
    [
        ({'anchor_positions': (0.0, 0.0, 2.0)}, 'anchor_positions'),
        ({'anchor_ids': ('A0', 'A0')}, r'anchor_ids\[1\]'),
        ({'anchor_ids': ('A0', '')}, r'anchor_ids\[1\]'),
        ({'anchor_biases': (0.1,)}, 'anchor_biases'),
        ({'range_std': 0.0}, 'range_std'),
    ],
)
def test_config_bad_value_is_named(changes, field):
    """A list of the wrong length, a repeated anchor and a zero deviation are named."""
    with pytest.raises(ConfigError, match=field):
        CONFIG.replace(**changes)


def test_nlos_test_none_never_has_a_say():
    result = Ranger(CONFIG.replace(nlos_test='none')).add(sample(gap=20.0))
    assert math.isnan(result.nlos_probability)
    assert result.los is LosState.UNKNOWN


def test_nlos_test_range_variance_finds_the_range_that_jumps():
    """Each anchor has a series of its own; few differences have no say."""
    ranger = Ranger(CONFIG.replace(nlos_test='range_variance', nlos_window=20))
    states = {'A0': [], 'A1': []}
    for k in range(1, 31):
        jump = 1.5 if k % 3 == 0 else 0.0
        for name, extra in (('A0', 0.0), ('A1', jump)):
            result = ranger.add(sample(k * SECOND, k, name, 5.0 + extra))
            states[name].append(result.los)
    assert set(states['A0'][10:]) == {LosState.LOS}
    assert set(states['A1'][10:]) == {LosState.NLOS}
    assert set(states['A0'][:6]) == {LosState.UNKNOWN}


def test_nlos_offset_is_taken_off_blocked_ranges_only():
    """Sun 37; a range that is shorter than the constant stays as it is."""
    ranger = Ranger(CONFIG.replace(nlos_offset=0.4))
    clear = ranger.add(sample(1 * SECOND, 1, gap=3.0))
    blocked = ranger.add(sample(2 * SECOND, 2, gap=20.0))
    short = ranger.add(sample(3 * SECOND, 3, gap=20.0, distance=0.3))
    assert clear.range_m == pytest.approx(5.0, abs=0.01)
    assert blocked.range_m == pytest.approx(4.6, abs=0.01)
    assert short.range_m == pytest.approx(0.3, abs=0.01)


def test_unknown_nlos_test_is_refused_with_the_names():
    with pytest.raises(ConfigError, match=r'nlos_test.*signal_quality'):
        CONFIG.replace(nlos_test='guess')


def measured(stamp=SECOND, anchor='A0', distance=5.0, gap=3.0):
    return RangeSample(
        stamp, anchor, 'tag', 1, distance, rx_power_dbm=-80.0, first_path_power_dbm=-80.0 - gap
    )


def test_take_calibrates_and_judges_a_devices_range():
    """As of an exchange; what the device gave is kept beside."""
    ranger = Ranger(CONFIG.replace(anchor_biases=(0.3, 0.0), anchor_scales=(0.02, 0.0)))
    result = ranger.take(measured(distance=5.4))
    assert isinstance(result, RangeSample)
    assert (result.raw_range_m, result.range_m) == (5.4, pytest.approx((5.4 - 0.3) / 1.02))
    assert result.variance_m2 == pytest.approx(CONFIG.range_std**2)
    assert result.los is LosState.LOS
    assert ranger.take(measured(2 * SECOND, gap=15.0)).los is LosState.NLOS


@pytest.mark.parametrize(
    ('bad', 'words'),
    [
        (measured(0), 'zero stamp'),
        (measured(SECOND), 'stamp does not advance'),
        (measured(2 * SECOND, 'A9'), 'unknown anchor'),
        (measured(2 * SECOND, distance=-0.5), 'negative range'),
        (measured(2 * SECOND, distance=80.0), 'range beyond max_range'),
        (measured(2 * SECOND, distance=math.nan), 'negative range'),
    ],
)
def test_take_refuses_what_cannot_be_and_goes_on(bad, words):
    ranger = Ranger(CONFIG)
    assert isinstance(ranger.take(measured()), RangeSample)
    refusal = ranger.take(bad)
    assert isinstance(refusal, Refusal)
    assert (refusal.source, refusal.reason) == ('uwb/device', words)
    assert isinstance(ranger.take(measured(3 * SECOND)), RangeSample)
