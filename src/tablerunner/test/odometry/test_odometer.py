"""The odometer: closed forms, gyro heading with its bias, silence of the IMU, covariance."""

import math

import numpy as np
import pytest

from tablerunner.odometry import MotionNoise, Odometer, OdometerConfig
from tablerunner.odometry.wheels import WheelsConfig
from tablerunner.types import ImuSample, OdometrySample, Refusal, WheelSample

RADIUS, TRACK, STEP = 0.06, 0.34, 20_000_000


def config(source='gyro', **noise):
    return OdometerConfig(
        heading_source=source,
        wheels=WheelsConfig(wheel_radius=RADIUS, track=TRACK),
        noise=MotionNoise(**noise),
    )


def drive(odometer, steps, speed, turn_rate, gyro_error=0.0, imu=True, start=1, angles=(0.0, 0.0)):
    """Feed constant driving; return the last odometry and the wheel angles."""
    left, right = angles
    last = None
    for k in range(start, start + steps):
        stamp = k * STEP
        if imu:
            for part in (STEP // 2, 0):
                odometer.add_imu(ImuSample(stamp - part, turn_rate + gyro_error))
        left += (speed - turn_rate * TRACK / 2) * 0.02 / RADIUS
        right += (speed + turn_rate * TRACK / 2) * 0.02 / RADIUS
        last = odometer.add_wheels(WheelSample(stamp, left, right))
        assert isinstance(last, OdometrySample)
    return last, (left, right)


@pytest.mark.parametrize('source', ['wheels', 'gyro'])
def test_add_wheels_quarter_circle_ends_at_its_end(source):
    """A quarter of a circle of radius 2 m ends at (2, 2) facing left, by either heading."""
    odometer = Odometer(config(source))
    drive(odometer, 1, 0.0, 0.0)
    steps, rate = 500, (math.pi / 2) / 10.0
    last, _ = drive(odometer, steps, 2 * rate, rate, start=2)
    # The gyro's rate jumps to `rate` within one sample: half an IMU step of turn is smoothed away.
    slack = 1e-4 if source == 'wheels' else 5e-3
    assert (last.pose.x, last.pose.y) == pytest.approx((2.0, 2.0), abs=slack)
    assert last.pose.heading == pytest.approx(math.pi / 2, abs=slack)
    assert (last.linear_m_s, last.angular_rad_s) == pytest.approx((2 * rate, rate), rel=1e-6)


def test_gyro_bias_learned_at_standstill_is_taken_off():
    """After two seconds of standing, a biased gyro drives straight."""
    odometer = Odometer(config())
    last, angles = drive(odometer, 100, 0.0, 0.0, gyro_error=0.02)
    assert odometer.gyro_bias == pytest.approx(0.02, abs=1e-6)
    last, _ = drive(odometer, 500, 0.5, 0.0, gyro_error=0.02, start=101, angles=angles)
    # What turned before the bias was known (half a second) stays.
    assert abs(last.pose.heading) < 0.02 * 0.6
    standing = last.pose.heading
    assert last.pose.y == pytest.approx(5.0 * math.sin(standing), abs=0.02)


def test_gyro_turning_while_wheels_stand_is_no_bias():
    """A robot that is lifted and turned must not learn the turning as bias."""
    odometer = Odometer(config())
    last, _ = drive(odometer, 50, 0.0, 0.0)
    for k in range(51, 151):
        odometer.add_imu(ImuSample(k * STEP, 0.5))
        last = odometer.add_wheels(WheelSample(k * STEP, 0.0, 0.0))
    assert abs(odometer.gyro_bias) < 1e-6
    assert last.pose.heading == pytest.approx(1.0, abs=0.02)


def test_gyro_ramp_is_integrated_exactly():
    """Readings that are means since the one before add up to the turn without error."""
    odometer = Odometer(config())
    for k in range(1, 102):
        odometer.add_imu(ImuSample(k * STEP, 0.01 * (k - 1.5)))
        last = odometer.add_wheels(WheelSample(k * STEP, 0.1 * k, 0.1 * k))
    assert last.pose.heading == pytest.approx(0.5 * 1.0 * 2.0, abs=1e-9)


def test_silent_imu_falls_back_to_the_wheels_and_says_so():
    """Without IMU the wheels give the turn; when it is back the gyro does again."""
    odometer = Odometer(config())
    last, angles = drive(odometer, 50, 0.5, 0.2)
    assert not odometer.fell_back
    heading = last.pose.heading
    last, angles = drive(odometer, 100, 0.5, 0.2, imu=False, start=51, angles=angles)
    assert odometer.fell_back
    assert last.pose.heading - heading == pytest.approx(0.4, abs=0.01)
    last, _ = drive(odometer, 20, 0.5, 0.2, start=151, angles=angles)
    assert not odometer.fell_back


def test_imu_that_comes_late_changes_nothing_in_the_end():
    """Wheel samples that overtake the IMU of the same instant end at the same heading."""
    rng = np.random.default_rng(2)
    rates = rng.normal(0, 0.5, 400)
    rates[:3] = 0.0  # standing until both have begun
    ends = []
    for lag in (0, 1):
        odometer = Odometer(config())
        pending, last = [], None
        for k, rate in enumerate(rates, start=1):
            pending.append(ImuSample(k * STEP, float(rate)))
            while len(pending) > lag:
                odometer.add_imu(pending.pop(0))
            last = odometer.add_wheels(WheelSample(k * STEP, 0.1 * k, 0.1 * k))
        for sample in pending:
            odometer.add_imu(sample)
        last = odometer.add_wheels(WheelSample(401 * STEP, 40.1, 40.1))
        ends.append(last.pose.heading)
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_covariance_matches_the_scatter_of_many_runs():
    """The covariance that is reported is the one that noisy motions really have."""
    noise = {'distance': 0.03, 'heading_per_turn': 0.05, 'heading_per_distance': 0.02}
    exact = Odometer(config('wheels', **noise, heading_per_time=0.0))
    drive(exact, 1, 0.0, 0.0)
    last, _ = drive(exact, 400, 0.5, 0.15, start=2)
    rng, runs = np.random.default_rng(8), 4000
    model = MotionNoise(**noise, heading_per_time=0.0)
    ds, dt = 0.5 * 0.02, 0.15 * 0.02
    sd_distance = noise['distance'] * math.sqrt(ds)
    sd_turn = math.sqrt(
        noise['heading_per_turn'] ** 2 * dt + noise['heading_per_distance'] ** 2 * ds
    )
    assert model.heading_per_time == 0.0
    x, y, heading = np.zeros(runs), np.zeros(runs), np.zeros(runs)
    for _ in range(400):
        length = ds + rng.normal(0, sd_distance, runs)
        turn = dt + rng.normal(0, sd_turn, runs)
        x += length * np.cos(heading + turn / 2)
        y += length * np.sin(heading + turn / 2)
        heading += turn
    scatter = np.cov(np.stack([x, y, heading]))
    # 4000 runs know a variance to 2.2 %; four of those, and the linearisation's second order.
    assert last.pose_covariance == pytest.approx(scatter, rel=0.12, abs=3e-5)


@pytest.mark.parametrize(
    ('bad', 'words'),
    [
        (ImuSample(0, 0.1), 'zero stamp'),
        (ImuSample(2 * STEP, math.nan), 'yaw rate not finite'),
        (ImuSample(2 * STEP, 50.0), 'yaw rate beyond max_rate'),
        (ImuSample(STEP, 0.1), 'stamp does not advance'),
    ],
)
def test_add_imu_bad_sample_is_refused_with_reason(bad, words):
    """Each fault of the IMU has its own words."""
    odometer = Odometer(config())
    assert odometer.add_imu(ImuSample(STEP, 0.0)) is None
    refusal = odometer.add_imu(bad)
    assert isinstance(refusal, Refusal)
    assert (refusal.source, refusal.reason) == ('imu/data', words)
