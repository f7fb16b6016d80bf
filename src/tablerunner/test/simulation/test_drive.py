"""The simulated base against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablerunner.geometry.angles import wrap
from tablerunner.scenario import DriveLimits
from tablerunner.simulation.drive import Drive
from tablerunner.types import Velocity

STEP_NS = 10_000_000
DT_S = 0.01
MakeDrive = Callable[..., Drive]


def run(drive: Drive, command: Velocity | None, steps: int, start_ns: int = 0) -> int:
    """Step with the command given anew each time (None: in silence); return the time after."""
    now = start_ns
    for _ in range(steps):
        if command is not None:
            assert drive.command(now, command)
        now += STEP_NS
        drive.step(now, DT_S)
    return now


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(linear=st.floats(-1.0, 1.0), angular=st.floats(-2.0, 2.0))
def test_drive_at_constant_command_follows_the_exact_arc(
    make_drive: MakeDrive, linear: float, angular: float
) -> None:
    """X = v/w sin(wt), y = v/w (1 - cos(wt)), heading = wt; the straight line for w = 0."""
    drive = make_drive()
    run(drive, Velocity(linear, angular), 200)
    turned = angular * 2.0
    if abs(angular) < 1e-6:
        x, y = linear * 2.0, linear * 2.0 * turned / 2
    else:
        x = linear / angular * math.sin(turned)
        y = linear / angular * (1.0 - math.cos(turned))
    assert (drive.pose.x, drive.pose.y) == pytest.approx((x, y), abs=1e-9)
    assert wrap(drive.pose.heading - turned) == pytest.approx(0.0, abs=1e-9)
    assert drive.linear_m_s == pytest.approx(linear, abs=1e-9)
    assert drive.angular_rad_s == pytest.approx(angular, abs=1e-9)


def test_drive_with_motor_lag_follows_the_step_response(make_drive: MakeDrive) -> None:
    """First-order lag: v (1 - exp(-t/T)) of speed, v (t - T (1 - exp(-t/T))) of way."""
    lag, speed = 0.15, 0.5
    drive = make_drive(motor_lag=lag)
    for steps in (10, 20, 70):
        run(drive, Velocity(speed), steps)
    rest = math.exp(-1.0 / lag)
    assert drive.pose.x == pytest.approx(speed * (1.0 - lag * (1.0 - rest)), abs=1e-12)


def test_drive_ramps_by_its_limits(make_drive: MakeDrive) -> None:
    """From rest with acceleration a: no faster than the limit, which it reaches at v/a."""
    limits = DriveLimits(speed=0.6, acceleration=0.5, turn_rate=1.0, turn_acceleration=2.0)
    drive = make_drive(limits=limits)
    run(drive, Velocity(9.0, 0.0), 60)
    assert drive.linear_m_s == pytest.approx(0.3, abs=1e-9)
    run(drive, Velocity(9.0, 9.0), 100, start_ns=60 * STEP_NS)
    assert drive.linear_m_s == pytest.approx(0.6)
    assert drive.angular_rad_s == pytest.approx(1.0)


def test_drive_limits_backward_speed(make_drive: MakeDrive) -> None:
    drive = make_drive(limits=DriveLimits(reverse_speed=0.2))
    run(drive, Velocity(-1.0), 100)
    assert drive.linear_m_s == pytest.approx(-0.2)


def test_drive_reverses_through_a_stand(make_drive: MakeDrive) -> None:
    """From +v to -v: first braked by the deceleration, then driven off by the acceleration."""
    limits = DriveLimits(speed=0.6, reverse_speed=0.6, acceleration=0.3, deceleration=1.2)
    drive = make_drive(limits=limits)
    now = run(drive, Velocity(0.6), 250)
    now = run(drive, Velocity(-0.6), 50, now)
    assert drive.linear_m_s == pytest.approx(0.0, abs=1e-9)
    run(drive, Velocity(-0.6), 100, now)
    assert drive.linear_m_s == pytest.approx(-0.3, abs=1e-9)


@pytest.mark.parametrize(('timeout', 'lag'), [(0.4, 0.08), (0.2, 0.0), (0.4, 0.2)])
def test_drive_without_commands_stops_in_the_computed_distance(
    make_drive: MakeDrive, timeout: float, lag: float
) -> None:
    """V t_out + v^2/(2a) + v T after the last command; the lag adds its time constant's way."""
    speed, braking = 0.7, 1.2
    limits = DriveLimits(speed=speed, acceleration=2.0, deceleration=braking)
    drive = make_drive(limits=limits, motor_lag=lag, command_timeout=timeout)
    now = run(drive, Velocity(speed), 400)
    assert drive.linear_m_s == pytest.approx(speed, abs=1e-6)
    last = now - STEP_NS  # the command before the last step was given there
    start = drive.pose.x - speed * DT_S
    while not drive.is_stale(now):
        now = run(drive, None, 1, now)
    assert now - last == pytest.approx(timeout * 1e9 + STEP_NS, abs=1)
    run(drive, None, 400, now)
    expected = speed * timeout + speed**2 / (2 * braking) + speed * lag
    assert drive.linear_m_s == pytest.approx(0.0, abs=1e-6)
    assert drive.pose.x - start == pytest.approx(expected, abs=1.5 * speed * DT_S)


def test_drive_before_any_command_stands(make_drive: MakeDrive) -> None:
    drive = make_drive()
    assert drive.is_stale(0)
    run(drive, None, 10)
    assert drive.pose.x == 0.0


@pytest.mark.parametrize('bad', [Velocity(math.nan), Velocity(0.0, math.inf)])
def test_drive_refuses_a_command_that_is_not_finite(make_drive: MakeDrive, bad: Velocity) -> None:
    """The last good command stays in force until it is too old."""
    drive = make_drive()
    drive.command(0, Velocity(0.5))
    assert not drive.command(0, bad)
    drive.step(STEP_NS, DT_S)
    assert drive.linear_m_s == pytest.approx(0.5)


def test_drive_with_unequal_wheels_curves(make_drive: MakeDrive) -> None:
    """Straight ahead by the nominal geometry is the arc w = v (r_r - r_l) / (r b) of the true."""
    drive = make_drive(seed=5, radius_scale_std=0.02, track_scale_std=0.02)
    run(drive, Velocity(0.6), 100)
    spin = 0.6 / 0.06
    expected = spin * (drive.right_radius_m - drive.left_radius_m) / drive.track_m
    assert expected != 0.0
    assert drive.pose.heading == pytest.approx(expected, rel=1e-9)


def test_drive_geometry_spreads_as_configured(make_drive: MakeDrive) -> None:
    """Over 400 seeds the relative errors have mean 0 and the standard deviations given."""
    drives = [
        make_drive(seed=seed, radius_scale_std=0.01, track_scale_std=0.02) for seed in range(400)
    ]
    left = np.array([drive.left_radius_m / 0.06 - 1 for drive in drives])
    right = np.array([drive.right_radius_m / 0.06 - 1 for drive in drives])
    track = np.array([drive.track_m / 0.34 - 1 for drive in drives])
    for values, std in ((left, 0.01), (right, 0.01), (track, 0.02)):
        assert abs(values.mean()) < 4 * std / 20
        assert values.std() == pytest.approx(std, rel=0.15)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.2


def cover(drive: Drive, speed: float, steps: int) -> float:
    """Return the way that the base covers at a constant command, summed from its speed."""
    covered = 0.0
    for step in range(steps):
        run(drive, Velocity(speed), 1, step * STEP_NS)
        covered += drive.linear_m_s * DT_S
    return covered


def test_drive_slips_as_often_and_as_long_as_configured(make_drive: MakeDrive) -> None:
    """Share of the way lost = share of the time slipping x mean share of the motion lost.

    A slip that begins during another replaces it, so the time slipping is that of a queue without
    end: 1 - exp(-rate x duration) for lengths of exponential spread comes close enough.
    """
    drive = make_drive(seed=1, slip_rate=0.5, slip_duration=0.2, slip_share=0.4)
    covered = cover(drive, 0.5, 30_000)
    rolled = (drive.left_angle_rad + drive.right_angle_rad) / 2 * 0.06
    assert rolled == pytest.approx(0.5 * 300, rel=1e-9)
    expected = (1.0 - math.exp(-0.5 * 0.2)) * 0.4 / 2
    assert 1.0 - covered / rolled == pytest.approx(expected, rel=0.2)


def test_drive_standing_does_not_slip(make_drive: MakeDrive) -> None:
    drive = make_drive(slip_rate=50.0, floor_noise=0.01)
    run(drive, Velocity(), 100)
    assert drive.pose.x == 0.0


def test_drive_floor_noise_grows_with_the_root_of_the_way(make_drive: MakeDrive) -> None:
    """After L metres each wheel is off by sigma sqrt(L), so the base by sigma sqrt(L/2)."""
    sigma = 0.01
    ways = [cover(make_drive(seed=seed, floor_noise=sigma), 1.0, 100) for seed in range(150)]
    assert np.std(ways) == pytest.approx(sigma * math.sqrt(0.5), rel=0.2)
    assert np.mean(ways) == pytest.approx(1.0, abs=4 * sigma / math.sqrt(300))


def test_drive_blocked_keeps_its_place_and_its_wheels_turn(make_drive: MakeDrive) -> None:
    drive = make_drive()
    run(drive, Velocity(0.5), 10)
    before = drive.pose
    drive.command(0, Velocity(0.5))
    drive.step(STEP_NS, DT_S)
    drive.block()
    assert (drive.pose.x, drive.pose.y) == (before.x, before.y)
    assert drive.linear_m_s == 0.0
    assert drive.left_angle_rad == pytest.approx(11 * 0.5 * DT_S / 0.06)
