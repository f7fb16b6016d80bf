"""Dead reckoning of many robots against `Odometer`, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.odometry import Motion, MotionNoise, Odometer, OdometerConfig
from tablerunner.odometry.batch import Motions, dead_reckon, variances
from tablerunner.types import ImuSample, WheelSample

CONFIG = OdometerConfig()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_track_equals_the_odometer(seed):
    """Stamps of all kinds: an IMU that pauses for less and for more than its timeout, slips."""
    rng = np.random.default_rng(seed)
    count, runs = 60, 3
    stamps = 1_000_000_000 + np.cumsum(rng.integers(2, 12, count)) * 10_000_000
    imu_stamps = 1_000_000_000 + np.cumsum(rng.integers(1, 14, 120)) * 10_000_000
    moves = rng.random((count, 1, 1)) < 0.7  # else all stand, for a while now and then
    moves |= (np.arange(count) // 15 % 2 == 0)[:, None, None]
    steps = np.clip(rng.normal(0.3, 0.2, (count, 2, runs)), -0.9, 0.9) * moves
    wheels = np.cumsum(steps, axis=0)
    rates = rng.normal(0.0, 0.03, (len(imu_stamps), runs))
    track = dead_reckon(CONFIG, stamps, wheels, imu_stamps, rates)
    for run in range(runs):
        odometer = Odometer(CONFIG)
        events = [(stamp, 0, index) for index, stamp in enumerate(stamps)]
        events += [(stamp, 1, index) for index, stamp in enumerate(imu_stamps)]
        found = []
        for stamp, kind, index in sorted(events):
            if kind:
                odometer.add_imu(ImuSample(int(stamp), float(rates[index, run])))
            else:
                sample = WheelSample(int(stamp), *(float(v) for v in wheels[index, :, run]))
                found.append(odometer.add_wheels(sample))
        places = np.array([(sample.pose.x, sample.pose.y) for sample in found])
        headings = np.array([sample.pose.heading for sample in found])
        assert track.place[:, :, run] == pytest.approx(places, abs=1e-9)
        assert np.cos(track.heading[:, run] - headings) == pytest.approx(np.ones(count))
        told = [sample.twist_covariance[0, 0] for sample in found[1:]]
        lasted = np.diff(stamps) * 1e-9
        assert np.diff(track.told_variance[:, run]) / lasted**2 == pytest.approx(told, abs=1e-9)


def test_variances_equal_those_of_single_motions():
    rng = np.random.default_rng(3)
    noise = MotionNoise()
    values = rng.normal(0, 0.1, 30), rng.normal(0, 0.1, 30), rng.uniform(0, 1, 30)
    told = rng.uniform(0, 0.02, 30) * (rng.random(30) < 0.7)
    distance, turn = variances(noise, Motions(*values, told))
    for index, single in enumerate(zip(*values, told, strict=True)):
        expected = noise.variances(Motion(*single))
        assert (distance[index], turn[index]) == pytest.approx(expected)
