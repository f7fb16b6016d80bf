"""Heading from a gyroscope: integration between any two stamps, and its bias at standstill."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.stream import Order, StampOrder
from tablerunner.types import ImuSample, Refusal, seconds

SOURCE = 'imu/data'


@dataclass(frozen=True)
class GyroConfig(Config):
    """When to believe the gyroscope."""

    timeout: float = parameter(
        0.1,
        unit='s',
        description='Silence of the IMU after which the wheels give the heading',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    max_rate: float = parameter(
        10.0,
        unit='rad/s',
        description='Yaw rates beyond this are refused',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    still_time: float = parameter(
        0.5,
        unit='s',
        description='Standstill after which the bias is learned',
        above=0.0,
        high=60.0,
        dynamic=True,
    )
    still_rate: float = parameter(
        0.05,
        unit='rad/s',
        description='Yaw rate above which the robot turns although its wheels stand (lifted)',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    bias_time_constant: float = parameter(
        5.0,
        unit='s',
        description='Time constant with which the bias is learned at standstill',
        above=0.0,
        high=1000.0,
        dynamic=True,
    )


class Gyro:
    """Integrates yaw rate; beyond the newest sample its rate is held.

    A reading is taken for the mean rate since the one before: gyroscopes run many times faster
    inside than they are read, and give averages.
    """

    def __init__(self, config: GyroConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget everything, as after a jump back in time."""
        self._order = StampOrder()
        self.bias = 0.0
        self._stamp = 0
        self._rate = 0.0
        self._angle = 0.0  # integral of the raw rate up to _stamp
        self._learned = 0.0  # seconds of standstill that went into the bias

    def add(self, sample: ImuSample) -> Refusal | None:
        """Take one sample; return why it is refused, if it is."""
        order = self._order.judge(sample.stamp)
        if order is Order.RESTARTED:
            self._stamp = 0
        elif order is not Order.NEWEST:
            return Refusal(sample.stamp, SOURCE, '', order.value)
        rate = sample.yaw_rate_rad_s
        if not math.isfinite(rate):
            return Refusal(sample.stamp, SOURCE, '', 'yaw rate not finite')
        if abs(rate) > self.config.max_rate:
            return Refusal(sample.stamp, SOURCE, '', 'yaw rate beyond max_rate')
        if self._stamp:
            dt = seconds(sample.stamp - self._stamp)
            if dt <= self.config.timeout:
                self._angle += rate * dt
        self._stamp = sample.stamp
        self._rate = rate
        return None

    def alive(self, stamp: int) -> bool:
        """Whether the newest sample is young enough to give the heading at `stamp`."""
        return self._stamp > 0 and seconds(stamp - self._stamp) <= self.config.timeout

    def angle(self, stamp: int) -> float:
        """Return the integral of the raw yaw rate up to a stamp [rad], from an arbitrary start."""
        return self._angle + self._rate * seconds(stamp - self._stamp)

    @property
    def rate(self) -> float:
        """Newest yaw rate, bias removed [rad/s]."""
        return self._rate - self.bias

    def learn_bias(self, mean_rate: float, dt_s: float) -> None:
        """Take the mean raw rate over dt_s of standstill into the bias.

        A running mean at first, so that the start converges at once; exponential forgetting with
        `bias_time_constant` afterwards, so that a walking bias is followed.
        """
        self._learned = min(self._learned + dt_s, self.config.bias_time_constant)
        self.bias += (mean_rate - self.bias) * min(1.0, dt_s / self._learned)
