"""A device's ranges under our names, of one tag, at the time at which they were measured."""

import random

import pytest

from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb.device.range_maker import RangeMaker
from tablerunner.uwb.protocol import DeviceRange, Dwm1001Shell, LinkTrack, Udp

START = 1_700_000_000_000_000_000


def same(stamp):
    return stamp


def made(maker, *ranges):
    return list(maker.make(ranges, same))


def test_name_tag_and_powers_go_along():
    maker = RangeMaker(LinkTrack(), {'anchor3': 'north'}, 'tag1')
    (sample,) = made(maker, DeviceRange(START, 'tag1', 'anchor3', 3.0, 0.5, -79.0, -81.5))
    assert sample == RangeSample(
        START, 'north', 'tag1', 1, 3.0, raw_range_m=3.0, rx_power_dbm=-79.0,
        first_path_power_dbm=-81.5,
    )  # fmt: skip


def test_unknown_anchor_is_refused_with_the_devices_id():
    maker = RangeMaker(LinkTrack(), {'anchor3': 'north'})
    (refusal,) = made(maker, DeviceRange(START, 'tag1', 'anchor4', 3.0))
    assert isinstance(refusal, Refusal)
    assert (refusal.key, refusal.reason) == ('anchor4', 'unknown anchor')


def test_ranges_of_two_tags_are_never_mixed():
    """The first that reports is taken; a reconnection lets another be the first."""
    maker = RangeMaker(Udp(), {})
    first, other = (DeviceRange(START, tag, 'A1', 3.0) for tag in ('T1', 'T2'))
    kinds = [type(item) for item in made(maker, first, other, first)]
    assert kinds == [RangeSample, Refusal, RangeSample]
    maker.reset()
    assert [type(item) for item in made(maker, other, first)] == [RangeSample, Refusal]


def test_wanted_tag_is_the_only_one():
    maker = RangeMaker(Udp(), {}, 'T2')
    first, other = (DeviceRange(START, tag, 'A1', 3.0) for tag in ('T1', 'T2'))
    assert [type(item) for item in made(maker, first, other)] == [Refusal, RangeSample]
    maker.reset()
    assert [type(item) for item in made(maker, first, other)] == [Refusal, RangeSample]


def test_frames_are_counted_where_the_device_does_not():
    """All ranges of one frame have one number, as AnchorWatch has to know."""
    maker = RangeMaker(Dwm1001Shell(), {})
    frames = [[DeviceRange(START + k, '', name, 3.0) for name in 'ab'] for k in range(3)]
    numbers = [[item.sequence for item in made(maker, *frame)] for frame in frames]
    assert numbers == [[1, 1], [2, 2], [3, 3]]


def test_long_sequence_number_fits_into_a_message():
    (sample,) = made(RangeMaker(Udp(), {}), DeviceRange(START, 'T', 'A1', 3.0, sequence=2**40 + 7))
    assert sample.sequence == 7


def test_device_time_takes_the_jitter_out():
    """Ticks of 1 ms, delays of 2 ms and more: stamps steadier than arrivals, the drift found.

    Bounds: 0.58 ms RMS, as ClockMapping's own tests have it for ticks of 1 ms; a tick over the
    minute that it has seen, 17 ppm.
    """
    rng = random.Random(3)
    maker = RangeMaker(LinkTrack(), {})
    errors = []
    for k in range(3000):
        true_ns = START + k * 20_000_000
        ticks = int((true_ns - START) * (1.0 - 120e-6) / 1e6) % 2**32
        arrival = true_ns + 2_000_000 + round(rng.expovariate(1.0) * 3e6)
        (sample,) = made(maker, DeviceRange(arrival, 'tag1', 'anchor1', 3.0, ticks=ticks))
        if k > 1000:
            errors.append((sample.stamp - true_ns - 2_000_000) / 1e6)
    rms = (sum(error**2 for error in errors) / len(errors)) ** 0.5
    assert rms < 0.58
    assert maker.words.startswith('device time, drift +')
    drift_ppm = float(maker.words.split('drift ')[1].split(' ')[0])
    assert drift_ppm == pytest.approx(120.0, abs=17.0)


def test_least_delay_is_taken_off():
    maker = RangeMaker(LinkTrack(), {}, least_delay_s=0.01)
    for k in range(400):
        arrival = START + k * 20_000_000
        (sample,) = made(maker, DeviceRange(arrival, 't', 'a', 3.0, ticks=20 * k))
    assert arrival - sample.stamp == pytest.approx(10_000_000, abs=1_000_000)


def test_without_device_time_the_arrival_is_the_stamp_and_it_is_said():
    maker = RangeMaker(Dwm1001Shell(), {})
    (sample,) = made(maker, DeviceRange(START, '', '022E', 3.0))
    assert sample.stamp == START
    assert maker.words == 'time of arrival'


def test_time_of_a_replay_is_moved():
    (sample,) = RangeMaker(Udp(), {}).make([DeviceRange(START, '', 'A', 3.0)], lambda at: at + 5)
    assert sample.stamp == START + 5
