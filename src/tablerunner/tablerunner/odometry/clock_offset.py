"""How far the stamps of the IMU are off those of the wheels, seen by both in every turn.

Wheels and gyroscope see the same turn rate. Where the stamps of the gyroscope are late by d, it
shows at t what the wheels showed at t - d: to first order, wheels - gyro = d * (change of the
rate). Least squares with forgetting gives d; only turns that begin or end tell something of it.
"""

from __future__ import annotations

import math

_MEMORY_S = 120.0
_BLOCK_S = 0.1  # over this time encoder steps and gyro noise average out
_LEAST_CHANGE = 0.1  # [rad/s^2]; less than this is noise


class ClockOffset:
    """Estimates the delay of the IMU's stamps against the wheels'.

    Attributes
    ----------
    delay_s : float
        By how much the IMU's stamps are later [s]; 0 before anything is known.
    deviation_s : float
        Standard deviation of it [s]; infinite before anything is known.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything, as after a jump back in time."""
        self.delay_s = 0.0
        self.deviation_s = math.inf
        self._block = (0.0, 0.0, 0.0)  # turns by wheels and gyro [rad], time [s]
        self._steps: list[tuple[float, float, float]] = []  # wheels, gyro [rad/s], dt [s]
        self._square = self._product = self._residual = self._weight = 0.0

    def add(self, wheels_rad: float, gyro_rad: float, dt_s: float) -> None:
        """Take the turns of one step by the wheels and by the gyroscope."""
        gathered = self._block
        self._block = (gathered[0] + wheels_rad, gathered[1] + gyro_rad, gathered[2] + dt_s)
        if self._block[2] < _BLOCK_S:
            return
        wheels_rad, gyro_rad, dt_s = self._block
        self._block = (0.0, 0.0, 0.0)
        self._steps.append((wheels_rad / dt_s, gyro_rad / dt_s, dt_s))
        if len(self._steps) < 3:
            return
        (_, before, first_s), (wheels, gyro, middle_s), (_, after, last_s) = self._steps
        del self._steps[0]
        change = (after - before) / (0.5 * (first_s + last_s) + middle_s)
        if abs(change) < _LEAST_CHANGE:
            return
        keep = math.exp(-dt_s / _MEMORY_S)
        apart = wheels - gyro
        self._square = keep * self._square + change * change
        self._product = keep * self._product + change * apart
        self._residual = keep * self._residual + (apart - self.delay_s * change) ** 2
        self._weight = keep * self._weight + 1.0
        self.delay_s = self._product / self._square
        noise = self._residual / self._weight
        self.deviation_s = math.sqrt(noise / self._square)
