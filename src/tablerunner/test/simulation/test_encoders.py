"""Encoders: whole ticks of the true angles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.scenario import WheelErrors
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.encoders import Encoders
from tablerunner.types import Velocity

STEP_NS = 10_000_000


@pytest.mark.parametrize('ticks', [16, 1024, 2048])
def test_encoders_read_whole_ticks_below_the_angle(
    make_drive: Callable[..., Drive], ticks: int
) -> None:
    """Readings are multiples of a tick, never above the angle and less than a tick below it."""
    drive = make_drive()
    encoders = Encoders(WheelErrors(ticks_per_turn=ticks), np.random.default_rng(3))
    tick = 2 * math.pi / ticks
    start = np.random.default_rng(3).random(2) * 2 * math.pi
    now = 0
    for _ in range(300):
        drive.command(now, Velocity(0.31, 0.4))
        now += STEP_NS
        drive.step(now, 0.01)
        sample = encoders.read(now, drive)
        for read, true in (
            (sample.left_angle_rad, start[0] + drive.left_angle_rad),
            (sample.right_angle_rad, start[1] + drive.right_angle_rad),
        ):
            assert read / tick == pytest.approx(round(read / tick), abs=1e-6)
            assert -1e-9 <= true - read < tick + 1e-9


def test_encoders_error_is_uniform_over_a_tick(make_drive: Callable[..., Drive]) -> None:
    """Rounding error of variance tick^2 / 12 and mean half a tick."""
    drive = make_drive()
    encoders = Encoders(WheelErrors(ticks_per_turn=100), np.random.default_rng(8))
    start = np.random.default_rng(8).random(2)[0] * 2 * math.pi
    tick = 2 * math.pi / 100
    errors, now = [], 0
    for index in range(4000):
        drive.command(now, Velocity(0.3 + 0.1 * math.sin(index)))
        now += STEP_NS
        drive.step(now, 0.01)
        errors.append(start + drive.left_angle_rad - encoders.read(now, drive).left_angle_rad)
    assert np.mean(errors) == pytest.approx(tick / 2, rel=0.05)
    assert np.std(errors) == pytest.approx(tick / math.sqrt(12), rel=0.05)


def test_encoders_speed_is_the_difference_of_readings(make_drive: Callable[..., Drive]) -> None:
    drive = make_drive()
    encoders = Encoders(WheelErrors(), np.random.default_rng(0))
    first = encoders.read(STEP_NS, drive)
    assert (first.left_speed_rad_s, first.right_speed_rad_s) == (0.0, 0.0)
    drive.command(STEP_NS, Velocity(0.6))
    drive.step(2 * STEP_NS, 0.01)
    drive.step(3 * STEP_NS, 0.01)
    second = encoders.read(3 * STEP_NS, drive)
    turned = second.left_angle_rad - first.left_angle_rad
    assert second.left_speed_rad_s == pytest.approx(turned / 0.02)
    assert second.left_speed_rad_s == pytest.approx(10.0, abs=2 * math.pi / 2048 / 0.02)


def test_encoders_without_ticks_read_the_angle(make_drive: Callable[..., Drive]) -> None:
    """ticks_per_turn of 0 switches the rounding off."""
    drive = make_drive()
    encoders = Encoders(WheelErrors(ticks_per_turn=0), np.random.default_rng(0))
    first = encoders.read(STEP_NS, drive)
    drive.command(0, Velocity(0.6))
    drive.step(2 * STEP_NS, 0.01)
    second = encoders.read(2 * STEP_NS, drive)
    assert second.left_angle_rad - first.left_angle_rad == pytest.approx(0.1, abs=1e-12)
