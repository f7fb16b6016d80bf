"""Dead reckoning: distance from the wheels, heading from wheels or gyroscope, and covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.clock_offset import ClockOffset
from tablerunner.odometry.gyro import Gyro, GyroConfig
from tablerunner.odometry.motion import Motion, MotionNoise, advance
from tablerunner.odometry.slip import SlipConfig, SlipWatch
from tablerunner.odometry.wheels import Wheels, WheelsConfig
from tablerunner.types import ImuSample, Matrix, OdometrySample, Refusal, WheelSample

HEADING_SOURCES = ('wheels', 'gyro')


@dataclass(frozen=True)
class OdometerConfig(Config):
    """Settings of dead reckoning."""

    heading_source: str = parameter(
        'gyro',
        description='What gives the turn: wheels (Sun 1-10) or gyro (Sun 11-14)',
        choices=HEADING_SOURCES,
    )
    wheels: WheelsConfig = parameter(factory=WheelsConfig, description='The drive wheels')
    gyro: GyroConfig = parameter(factory=GyroConfig, description='The gyroscope')
    slip: SlipConfig = parameter(factory=SlipConfig, description='When wheels count as slipping')
    noise: MotionNoise = parameter(factory=MotionNoise, description='Growth of the covariance')


class Odometer:
    """Adds up motions into a pose in the odom frame, which starts at the origin.

    With ``heading_source: gyro`` each interval turns by the integral of the gyroscope less the
    bias that was learned while the wheels stood; the distance is laid along the mean heading (Sun
    11-14). While the IMU is silent the wheels give the turn, and each such interval is reported
    as a refusal with the reason ``imu silent`` beside its odometry (`fell_back`). Where wheels and
    gyroscope disagree on the turn, a wheel slips (`slipping`), and the distance is doubted.
    """

    def __init__(self, config: OdometerConfig) -> None:
        self.config = config
        self._wheels = Wheels(config.wheels)
        self._gyro = Gyro(config.gyro)
        self._slip = SlipWatch(config.slip, config.wheels.track)
        self._offset = ClockOffset()
        self.reset()

    def configure(self, config: OdometerConfig) -> None:
        """Use other dynamic settings from now on; the pose goes on."""
        self.config = config
        self._wheels.config = config.wheels
        self._gyro.config = config.gyro
        self._slip.config = config.slip

    def reset(self) -> None:
        """Start again at the origin of odom, as after a jump back in time."""
        self._wheels.reset()
        self._gyro.reset()
        self._slip.reset()
        self._offset.reset()
        self._pose = Pose2()
        self._covariance = np.zeros((3, 3))
        self._angle_used: float | None = None  # gyro integral at the last wheel sample
        self._still = 0.0
        self.fell_back = False

    @property
    def gyro_bias(self) -> float:
        """Bias of the yaw rate that was learned at standstill [rad/s]."""
        return self._gyro.bias

    @property
    def slipping(self) -> bool:
        """Whether wheels and gyroscope disagreed on the last turn."""
        return self._slip.slipping

    @property
    def slips(self) -> int:
        """Slips so far."""
        return self._slip.count

    @property
    def imu_delay(self) -> tuple[float, float]:
        """By how much the IMU's stamps are later than the wheels', and its deviation [s]."""
        return self._offset.delay_s, self._offset.deviation_s

    def add_imu(self, sample: ImuSample) -> Refusal | None:
        """Take one IMU sample; return why it is refused, if it is."""
        return self._gyro.add(sample)

    def add_wheels(self, sample: WheelSample) -> OdometrySample | Refusal:
        """Take one encoder sample; return the pose that it leads to, or why it is refused.

        The first sample gives the pose at the origin.
        """
        motion = self._wheels.add(sample)
        if isinstance(motion, Refusal):
            return motion
        if motion is None:
            self._angle_used = self._gyro_angle(sample.stamp)
            return self._sample(sample.stamp, Motion(0.0, 0.0, 0.0))
        self._slip.slipping = False
        if self.config.heading_source == 'gyro':
            motion = self._turn_by_gyro(motion, sample.stamp)
        self._covariance = _grow(self._covariance, self._pose, motion, self.config.noise)
        self._pose = advance(self._pose, motion)
        return self._sample(sample.stamp, motion)

    def _gyro_angle(self, stamp: int) -> float | None:
        return self._gyro.angle(stamp) if self._gyro.alive(stamp) else None

    def _turn_by_gyro(self, wheels: Motion, stamp: int) -> Motion:
        angle, before = self._gyro_angle(stamp), self._angle_used
        self._angle_used = angle
        self.fell_back = angle is None or before is None
        if angle is None or before is None:
            self._still = 0.0
            return wheels
        turned = angle - before
        drift = turned - self._gyro.bias * wheels.dt_s
        self._offset.add(wheels.turn_rad, drift, wheels.dt_s)
        missing = self._slip.add(wheels.turn_rad, drift, wheels.distance_m, wheels.dt_s)
        stands = wheels.distance_m == 0.0 and wheels.turn_rad == 0.0  # not one encoder tick
        if not stands or abs(drift) > self.config.gyro.still_rate * wheels.dt_s:
            self._still = 0.0
        else:
            self._still += wheels.dt_s
            if self._still > self.config.gyro.still_time:
                self._gyro.learn_bias(turned / wheels.dt_s, wheels.dt_s)
                # Wheels that stand do not turn the robot: hold the heading.
                return wheels
        return Motion(wheels.distance_m, drift, wheels.dt_s, missing)

    def _sample(self, stamp: int, motion: Motion) -> OdometrySample:
        dt = motion.dt_s
        twist_covariance = np.zeros((2, 2))
        if dt > 0.0:
            distance, turn = self.config.noise.variances(motion)
            twist_covariance[0, 0], twist_covariance[1, 1] = distance / dt**2, turn / dt**2
        return OdometrySample(
            stamp,
            self._pose,
            motion.distance_m / dt if dt > 0.0 else 0.0,
            motion.turn_rad / dt if dt > 0.0 else 0.0,
            self._covariance,
            twist_covariance,
        )


def _grow(covariance: Matrix, pose: Pose2, motion: Motion, noise: MotionNoise) -> Matrix:
    """Return the covariance of x, y, heading after a motion from `pose`, first order.

    F P F' + G N G' written out, which is several times faster than six products of tiny matrices:
    F = [[1, 0, fx], [0, 1, fy], [0, 0, 1]], G = [[cos, fx / 2], [sin, fy / 2], [0, 1]].
    """
    direction = pose.heading + 0.5 * motion.turn_rad
    cos, sin = math.cos(direction), math.sin(direction)
    fx, fy = -motion.distance_m * sin, motion.distance_m * cos
    distance, turn = noise.variances(motion)
    (xx, xy, xh), (_, yy, yh), (_, _, hh) = covariance.tolist()
    new_xx = xx + 2.0 * fx * xh + fx * fx * (hh + 0.25 * turn) + distance * cos * cos
    new_yy = yy + 2.0 * fy * yh + fy * fy * (hh + 0.25 * turn) + distance * sin * sin
    new_xy = xy + fx * yh + fy * xh + fx * fy * (hh + 0.25 * turn) + distance * cos * sin
    new_xh = xh + fx * (hh + 0.5 * turn)
    new_yh = yh + fy * (hh + 0.5 * turn)
    return np.array(
        [[new_xx, new_xy, new_xh], [new_xy, new_yy, new_yh], [new_xh, new_yh, hh + turn]]
    )
