"""The simulated IMU: what a gyroscope and two accelerometers read on a flat floor."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.scenario import ImuErrors, RobotGeometry
from tablerunner.simulation.drive import Drive
from tablerunner.types import ImuSample, seconds


class Imu:
    """Means over the time since the last reading, times a scale, plus bias and noise.

    The gyroscope's bias starts anywhere and walks (a Wiener process); its scale and the biases of
    the accelerometers stay. Accelerations are those of the IMU's place, not of base_link.
    """

    def __init__(
        self, robot: RobotGeometry, errors: ImuErrors, drive: Drive, random: np.random.Generator
    ) -> None:
        self._errors = errors
        self._random = random
        self._x_m, self._y_m, _ = robot.imu_position
        draws = random.standard_normal(4)
        self.gyro_bias_rad_s = float(draws[0]) * errors.gyro_bias_std
        self.gyro_scale = 1.0 + float(draws[1]) * errors.gyro_scale_std
        self._acceleration_bias = draws[2:] * errors.acceleration_bias_std
        self._turned_rad = 0.0
        self._stamp: int | None = None
        self._linear_m_s = drive.linear_m_s
        self._angular_rad_s = drive.angular_rad_s

    def feel(self, drive: Drive, dt_s: float) -> None:
        """Integrate one step of the motion."""
        self._turned_rad += drive.angular_rad_s * dt_s

    def read(self, stamp: int, drive: Drive, period_s: float) -> ImuSample:
        """Return a reading; `period_s` is the time since the last, for the first one."""
        errors = self._errors
        dt_s = period_s if self._stamp is None else seconds(stamp - self._stamp)
        rate = self._turned_rad / dt_s
        forward = (drive.linear_m_s - self._linear_m_s) / dt_s
        spin = (drive.angular_rad_s - self._angular_rad_s) / dt_s
        # Rigid body: acceleration of a point off the axis, in base_link.
        ahead = forward - spin * self._y_m - rate**2 * self._x_m
        left = drive.linear_m_s * rate + spin * self._x_m - rate**2 * self._y_m
        draws = self._random.standard_normal(4)
        self.gyro_bias_rad_s += errors.gyro_bias_walk * math.sqrt(dt_s) * float(draws[0])
        bias = self._acceleration_bias
        sample = ImuSample(
            stamp,
            self.gyro_scale * rate + self.gyro_bias_rad_s + errors.gyro_std * float(draws[1]),
            ahead + float(bias[0]) + errors.acceleration_std * float(draws[2]),
            left + float(bias[1]) + errors.acceleration_std * float(draws[3]),
            yaw_rate_variance=errors.gyro_std**2,
        )
        self._stamp = stamp
        self._turned_rad = 0.0
        self._linear_m_s = drive.linear_m_s
        self._angular_rad_s = drive.angular_rad_s
        return sample
