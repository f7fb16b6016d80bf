"""Slips are told from turns, and what they may have cost is added up."""

import numpy as np
import pytest

from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.odometry.slip import SlipConfig, SlipWatch
from tablerunner.odometry.wheels import WheelsConfig
from tablerunner.types import ImuSample, WheelSample

TRACK, RADIUS, STEP = 0.34, 0.06, 20_000_000


def watch():
    return SlipWatch(SlipConfig(), TRACK)


def test_add_no_slip_where_track_and_radii_explain_the_difference():
    """Two percent of track error, one of radii, and the noise of a tick are no slip."""
    rng = np.random.default_rng(1)
    slip = watch()
    for _ in range(2000):
        speed, rate = rng.uniform(0.0, 0.6), rng.uniform(-1.2, 1.2)
        told = 1.02 * rate + 0.01 * speed / TRACK + rng.choice([-1, 0, 1]) * 0.027
        assert slip.add(told * 0.02, rate * 0.02, speed * 0.02, 0.02) == 0.0
    assert (slip.slipping, slip.count) == (False, 0)


def test_add_slip_of_one_wheel_adds_half_of_its_lost_way():
    """A wheel that loses 5 cm in one go leaves a deviation of 2.5 cm, in any number of steps."""
    slip = watch()
    steps = 25
    lost = 0.05 / steps
    variance = sum(slip.add(lost / TRACK, 0.0, 0.01 - lost / 2, 0.01) for _ in range(steps))
    assert variance**0.5 == pytest.approx(0.025)
    assert (slip.slipping, slip.count) == (True, 1)


def test_add_two_slips_apart_are_two():
    """After a pause the next slip starts from nothing: variances add, not deviations."""
    slip = watch()
    once = slip.add(0.02, 0.0, 0.01, 0.02)
    for _ in range(20):
        slip.add(0.0, 0.0, 0.01, 0.02)
    assert slip.add(0.02, 0.0, 0.01, 0.02) == pytest.approx(once)
    assert slip.count == 2


def test_odometer_slip_grows_the_covariance_of_distance():
    """One wheel spins for half a second on a straight: odometry doubts its speed, and says so."""
    odometer = Odometer(OdometerConfig(wheels=WheelsConfig(wheel_radius=RADIUS, track=TRACK)))
    left = right = 0.0
    deviations, slipping = [], []
    for k in range(1, 101):
        for part in (STEP // 2, 0):
            odometer.add_imu(ImuSample(k * STEP - part, 0.0))
        left += 0.01 / RADIUS
        right += (0.015 if 50 <= k < 75 else 0.01) / RADIUS
        sample = odometer.add_wheels(WheelSample(k * STEP, left, right))
        deviations.append(sample.twist_covariance[0, 0] ** 0.5)
        slipping.append(odometer.slipping)
    assert max(deviations[49:74]) > 5 * max(deviations[1:48])
    assert deviations[80] == pytest.approx(deviations[20])
    assert [k for k, value in enumerate(slipping, 1) if value] == list(range(50, 75))
    assert odometer.slips == 1
