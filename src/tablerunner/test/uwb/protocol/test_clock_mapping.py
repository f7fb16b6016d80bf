"""Device time to host time, against simulated clocks: drift, jitter, wraps, resets."""

import math

import numpy as np
import pytest

from tablerunner.uwb.protocol.clock_mapping import ClockMapping

LEAST_S = 0.002


def simulate(seed, drift=None, jitter_s=0.003, rate=50.0, seconds=60.0, zero=12_345, tick_ns=1e6):
    """Return device ticks, arrivals and true host times [ns], and the drift.

    Delays: a least one, an exponential share, and one in a hundred late by up to 0.1 s. What
    arrives keeps its order. The device counts whole ticks, and wraps at 32 bits.
    """
    rng = np.random.default_rng(seed)
    if drift is None:
        drift = rng.uniform(-4e-5, 4e-5)
    count = int(seconds * rate)
    times = np.arange(count) / rate + rng.uniform(0.0, 1.0)
    true = 1_700_000_000_000_000_000 + np.round(times * 1e9).astype(np.int64)
    ticks = (zero + np.floor(times * 1e9 * (1.0 - drift) / tick_ns).astype(np.int64)) % 2**32
    delay = LEAST_S + rng.exponential(jitter_s, count)
    delay += np.where(rng.random(count) < 0.01, rng.uniform(0.0, 0.1, count), 0.0)
    arrivals = np.maximum.accumulate(true + np.round(delay * 1e9).astype(np.int64))
    return ticks.tolist(), arrivals.tolist(), true, drift


def run(ticks, arrivals, tick_ns=1e6, bits=32):
    """Return a mapping and what it gave."""
    mapping = ClockMapping(tick_ns, bits, LEAST_S)
    return mapping, [mapping.add(*pair) for pair in zip(ticks, arrivals, strict=True)]


def errors(given, true):
    """Return errors and deviations [s]."""
    stamps = np.array([item.stamp for item in given])
    return (stamps - true) * 1e-9, np.array([item.deviation_s for item in given])


@pytest.mark.parametrize('jitter_s', [0.0005, 0.003, 0.01])
def test_stamps_are_good_to_a_tick_whatever_the_jitter(jitter_s):
    """Over ten clocks: below what an unknown place within a tick of 1 ms makes, 1 / sqrt(3) ms.

    Where messages come in step with the ticks, all are rounded alike, which nothing shows. The
    arrivals themselves are 8 to 19 ms late. Judged after the first 15 s.
    """
    every = []
    for seed in range(10):
        ticks, arrivals, true, _ = simulate(seed, jitter_s=jitter_s)
        off, _ = errors(run(ticks, arrivals)[1], true)
        every.append(off[750:])
    every = np.concatenate(every)
    assert np.sqrt(np.mean(every**2)) < 0.00058
    assert abs(np.mean(every)) < 0.0005


def test_fine_ticks_give_stamps_far_below_the_jitter():
    """A counter of microseconds and 3 ms of jitter: 0.1 ms RMS over ten clocks."""
    for seed in range(10):
        ticks, arrivals, true, _ = simulate(seed, tick_ns=1e3)
        off, _ = errors(run(ticks, arrivals, 1e3)[1], true)
        assert np.sqrt(np.mean(off[750:] ** 2)) < 1e-4


@pytest.mark.parametrize(('rate', 'seconds'), [(50.0, 60.0), (10.0, 120.0), (0.2, 600.0)])
def test_deviation_says_how_good_a_stamp_is(rate, seconds):
    """Twenty clocks: 99 % within three deviations, which are no more than eight times too large.

    Also with a tag that reports every five seconds, as one that stands still.
    """
    inside, ratio = [], []
    for seed in range(20):
        ticks, arrivals, true, _ = simulate(seed, rate=rate, seconds=seconds)
        off, deviation = errors(run(ticks, arrivals)[1], true)
        late = slice(off.size // 4, None)
        inside.append(np.mean(np.abs(off[late]) < 3.0 * deviation[late]))
        ratio.append(np.sqrt(np.mean(off[late] ** 2) / np.mean(deviation[late] ** 2)))
    assert np.mean(inside) > 0.99
    assert np.mean(ratio) > 1.0 / 8.0


def test_drift_is_found_within_its_deviation():
    """Over thirty clocks of up to 40 ppm: normalised errors of 1 or less in the mean square."""
    normalised = []
    for seed in range(30):
        ticks, arrivals, _, drift = simulate(seed, seconds=120.0)
        mapping, _ = run(ticks, arrivals)
        assert mapping.drift == pytest.approx(drift, abs=2e-5)
        normalised.append((mapping.drift - drift) / mapping.drift_deviation)
    assert 0.3 < np.sqrt(np.mean(np.square(normalised))) < 1.5


def test_stamps_never_go_back_nor_lie_after_their_arrival():
    """From the first on, while the edge is still being found."""
    for seed in range(10):
        ticks, arrivals, _, _ = simulate(seed, seconds=20.0)
        _, given = run(ticks, arrivals)
        stamps = [item.stamp for item in given]
        assert stamps == sorted(stamps)
        assert all(stamp <= arrival for stamp, arrival in zip(stamps, arrivals, strict=True))


@pytest.mark.parametrize('zero', [0, 2**32 - 20_000, 2**31 - 20_000])
def test_wrap_of_the_counter_changes_nothing(zero):
    """The counter starts over after 20 s; every stamp as without."""
    plain = run(*simulate(3, zero=5)[:2])[1]
    ticks, arrivals, _, _ = simulate(3, zero=zero)
    mapping, given = run(ticks, arrivals)
    assert [item.stamp for item in given] == pytest.approx([item.stamp for item in plain], abs=1)
    assert mapping.restarts == mapping.outliers == 0


def test_silence_of_several_wraps_is_bridged():
    """A 24-bit counter of 1 ms wraps every 4.7 h; the tag was off for ten."""
    ticks, arrivals, true, _ = simulate(4, drift=0.0)
    pause = 36_000_000  # [ms]
    ticks = [tick % 2**24 for tick in ticks] + [(tick + 60_000 + pause) % 2**24 for tick in ticks]
    arrivals += [item + (60_000 + pause) * 10**6 for item in arrivals]
    true = np.concatenate([true, true + (60_000 + pause) * 10**6])
    mapping, given = run(ticks, arrivals, bits=24)
    off, _ = errors(given, true)
    assert mapping.restarts == mapping.outliers == 0
    assert np.abs(off[-1000:]).max() < 0.002


def test_reset_of_the_device_is_known_after_three_times():
    """The counter begins anew: arrival times for three to five seconds, said so, then good."""
    ticks, arrivals, true, _ = simulate(5, zero=10_000_000)
    half = len(ticks) // 2
    first = ticks[half]
    ticks = ticks[:half] + [tick - first + 300 for tick in ticks[half:]]
    mapping, given = run(ticks, arrivals)
    assert mapping.restarts == 1
    by_device = [item.by_device for item in given]
    assert not any(by_device[half : half + 150])
    assert all(by_device[200:half])
    assert all(by_device[half + 250 :])
    assert given[half].stamp == arrivals[half]
    assert math.isnan(given[half].deviation_s)
    off, _ = errors(given, true)
    assert np.sqrt(np.mean(off[half + 750 :] ** 2)) < 0.0006


def test_one_wrong_time_is_answered_by_its_arrival():
    """A time that passed the checksum by chance: only its own stamp is the arrival."""
    ticks, arrivals, true, _ = simulate(6)
    for place in (400, 1500, 1501):
        ticks[place] = (ticks[place] + 2**30) % 2**32
    mapping, given = run(ticks, arrivals)
    by_arrival = [index for index, item in enumerate(given) if not item.by_device]
    assert [index for index in by_arrival if index > 250] == [400, 1500, 1501]
    assert mapping.outliers == 3
    assert mapping.restarts == 0
    assert np.abs(errors(given, true)[0][750:1500]).max() < 0.002


def test_time_that_goes_back_a_little_is_no_time_of_this_device():
    """100 ms back, which a late message could explain: answered by its arrival."""
    ticks, arrivals, _, _ = simulate(9)
    ticks[1500] -= 100
    mapping, given = run(ticks, arrivals)
    assert [index for index in range(250, len(given)) if not given[index].by_device] == [1500]
    assert (mapping.outliers, mapping.restarts) == (1, 0)


def test_backlog_of_a_port_that_was_opened_late_is_unwound():
    """The first two seconds arrive all at once: the stamps are as good as ever 15 s later."""
    ticks, arrivals, true, _ = simulate(7)
    arrivals[:100] = [arrivals[100]] * 100
    _, given = run(ticks, arrivals)
    off, _ = errors(given, true)
    assert off.min() > -0.02
    assert np.sqrt(np.mean(off[750:] ** 2)) < 0.00058


@pytest.mark.parametrize('wrong', [0.1, 0.9, 1.01, 10.0, 1000.0])
def test_wrong_tick_gives_arrival_times_and_says_so(wrong):
    """A tick that is not what was told: arrival times, and before that no stamp 0.2 s early."""
    ticks, arrivals, true, _ = simulate(8)
    mapping, given = run(ticks, arrivals, 1e6 * wrong)
    assert not any(item.by_device for item in given[750:])
    assert not mapping.usable
    off, _ = errors(given, true)
    assert off.min() > -0.2


def test_several_ranges_of_one_frame_share_their_stamp():
    mapping = ClockMapping(1e6, 32)
    for step in range(100):
        first = mapping.add(20 * step, 1_000_000_000 + 20_000_000 * step)
        again = mapping.add(20 * step, 1_000_000_000 + 20_000_000 * step)
        assert first.stamp == again.stamp
