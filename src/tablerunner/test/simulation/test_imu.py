"""The simulated IMU against closed forms and its own statistics."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from tablerunner.scenario import ImuErrors, RobotGeometry, SensorErrors
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.imu import Imu
from tablerunner.types import ImuSample, Velocity

STEP_NS = 10_000_000
MakeDrive = Callable[..., Drive]


def readings(imu: Imu, drive: Drive, command: Velocity, steps: int, every: int) -> list[ImuSample]:
    now, samples = 0, []
    for step in range(1, steps + 1):
        drive.command(now, command)
        now += STEP_NS
        drive.step(now, 0.01)
        imu.feel(drive, 0.01)
        if step % every == 0:
            samples.append(imu.read(now, drive, every * 0.01))
    return samples


@pytest.mark.parametrize('every', [1, 10])
def test_imu_without_errors_integrates_to_the_heading(make_drive: MakeDrive, every: int) -> None:
    """A reading is the mean rate since the last one, so that nothing is lost at any rate."""
    drive = make_drive(motor_lag=0.3)
    imu = Imu(RobotGeometry(), SensorErrors().ideal().imu, drive, np.random.default_rng(0))
    samples = readings(imu, drive, Velocity(0.4, 0.7), 300, every)
    turned = sum(sample.yaw_rate_rad_s for sample in samples) * every * 0.01
    assert turned == pytest.approx(drive.pose.heading, abs=1e-9)
    assert math.isnan(samples[0].yaw_rad)


def test_imu_on_a_circle_feels_the_centre(make_drive: MakeDrive) -> None:
    """V w to the left at base_link; off the axis w^2 r less, and nothing ahead."""
    drive = make_drive()
    robot = RobotGeometry(imu_position=(0.1, 0.05, 0.1))
    imu = Imu(robot, SensorErrors().ideal().imu, drive, np.random.default_rng(0))
    last = readings(imu, drive, Velocity(0.5, 0.8), 50, 1)[-1]
    assert last.forward_acceleration_m_s2 == pytest.approx(-(0.8**2) * 0.1)
    assert last.lateral_acceleration_m_s2 == pytest.approx(0.5 * 0.8 - 0.8**2 * 0.05)


def test_imu_driving_off_feels_the_acceleration(make_drive: MakeDrive) -> None:
    """Sum of forward acceleration times dt is the speed."""
    drive = make_drive(motor_lag=0.2)
    imu = Imu(RobotGeometry(), SensorErrors().ideal().imu, drive, np.random.default_rng(0))
    samples = readings(imu, drive, Velocity(0.5), 100, 1)
    gained = sum(sample.forward_acceleration_m_s2 for sample in samples) * 0.01
    assert gained == pytest.approx(drive.linear_m_s, abs=1e-9)


def test_imu_noise_is_normal_with_the_configured_spread(still_drive: Drive) -> None:
    errors = SensorErrors().ideal().imu.replace(gyro_std=0.005, acceleration_std=0.05)
    imu = Imu(RobotGeometry(), errors, still_drive, np.random.default_rng(1))
    samples = readings(imu, still_drive, Velocity(), 4000, 1)
    rates = [sample.yaw_rate_rad_s for sample in samples]
    assert stats.kstest(rates, stats.norm(0, 0.005).cdf).pvalue > 0.01
    ahead = [sample.forward_acceleration_m_s2 for sample in samples]
    assert stats.kstest(ahead, stats.norm(0, 0.05).cdf).pvalue > 0.01
    assert samples[0].yaw_rate_variance == pytest.approx(0.005**2)


def test_imu_bias_walks_with_the_root_of_time(still_drive: Drive) -> None:
    """Spread over 300 seeds: the start's, then start^2 + walk^2 t."""
    errors = SensorErrors().ideal().imu.replace(gyro_bias_std=0.01, gyro_bias_walk=0.01)
    first, last = [], []
    for seed in range(300):
        imu = Imu(RobotGeometry(), errors, still_drive, np.random.default_rng(seed))
        first.append(imu.gyro_bias_rad_s)
        for quarter in range(1, 17):
            imu.read(quarter * 250_000_000, still_drive, 0.25)
        last.append(imu.gyro_bias_rad_s)
    assert np.std(first) == pytest.approx(0.01, rel=0.15)
    assert np.std(last) == pytest.approx(math.sqrt(0.01**2 + 0.01**2 * 4), rel=0.15)


def test_imu_scale_is_drawn_once(make_drive: MakeDrive) -> None:
    drive = make_drive()
    errors: ImuErrors = SensorErrors().ideal().imu.replace(gyro_scale_std=0.05)
    imu = Imu(RobotGeometry(), errors, drive, np.random.default_rng(2))
    samples = readings(imu, drive, Velocity(0.0, 1.0), 20, 1)
    assert imu.gyro_scale != 1.0
    assert [sample.yaw_rate_rad_s for sample in samples] == pytest.approx([imu.gyro_scale] * 20)
