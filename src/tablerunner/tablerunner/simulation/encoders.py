"""Wheel encoders: angles in whole ticks."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.scenario import WheelErrors
from tablerunner.simulation.drive import Drive
from tablerunner.types import WheelSample, seconds


class Encoders:
    """Reads the angles of both wheels, rounded down to whole ticks.

    The wheels stand at any angle at the start. Speeds are what a driver makes of two readings: the
    difference of angles over the time between.
    """

    def __init__(self, errors: WheelErrors, random: np.random.Generator) -> None:
        self._tick_rad = 2 * math.pi / errors.ticks_per_turn if errors.ticks_per_turn else 0.0
        self._start_rad = [float(angle) for angle in random.random(2) * 2 * math.pi]
        self._last: WheelSample | None = None

    @property
    def tick_rad(self) -> float:
        """Angle of one tick; 0 when the encoder is not quantised."""
        return self._tick_rad

    def read(self, stamp: int, drive: Drive) -> WheelSample:
        """Return a reading."""
        left = self._quantise(self._start_rad[0] + drive.left_angle_rad)
        right = self._quantise(self._start_rad[1] + drive.right_angle_rad)
        if self._last is None:
            sample = WheelSample(stamp, left, right, 0.0, 0.0)
        else:
            dt_s = seconds(stamp - self._last.stamp)
            sample = WheelSample(
                stamp,
                left,
                right,
                (left - self._last.left_angle_rad) / dt_s,
                (right - self._last.right_angle_rad) / dt_s,
            )
        self._last = sample
        return sample

    def _quantise(self, angle_rad: float) -> float:
        if self._tick_rad == 0.0:
            return angle_rad
        return math.floor(angle_rad / self._tick_rad) * self._tick_rad
