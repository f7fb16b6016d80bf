"""Inertial units: sensor_msgs/Imu as ImuSample, sensor_msgs/MagneticField as MagneticSample."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.geometry.angles import wrap
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import ImuSample, MagneticSample, Refusal

IMU_SOURCE = 'imu/data'
MAGNETIC_SOURCE = 'imu/mag'


def imu_from_message(message: Any, mount_heading: float = 0.0) -> ImuSample | Refusal:
    """Return what a robot on a flat floor uses of an IMU.

    A first covariance element of -1 means "not measured", as sensor_msgs/Imu defines.

    Parameters
    ----------
    message : sensor_msgs.msg.Imu
        In the IMU's own frame, its z axis upward.
    mount_heading : float
        Heading of the IMU's frame in base_link [rad].
    """
    stamp = stamp_from_message(message.header.stamp)
    rate_variance = message.angular_velocity_covariance
    if rate_variance[0] == -1.0:
        return Refusal(stamp, IMU_SOURCE, '', 'gives no angular velocity')
    rate = message.angular_velocity.z
    if not math.isfinite(rate):
        return Refusal(stamp, IMU_SOURCE, '', 'turn rate is not finite')
    variance = float(rate_variance[8])
    if not (math.isfinite(variance) and variance >= 0.0):
        return Refusal(stamp, IMU_SOURCE, '', 'variance is not a finite number of at least 0')
    heading = math.nan
    if message.orientation_covariance[0] != -1.0:
        heading = heading_from_quaternion(message.orientation)
        if math.isnan(heading):
            return Refusal(stamp, IMU_SOURCE, '', quaternion_fault(message.orientation))
        heading = wrap(heading - mount_heading)
    forward = lateral = math.nan
    if message.linear_acceleration_covariance[0] != -1.0:
        forward, lateral = message.linear_acceleration.x, message.linear_acceleration.y
        if mount_heading:
            cos, sin = math.cos(mount_heading), math.sin(mount_heading)
            forward, lateral = cos * forward - sin * lateral, sin * forward + cos * lateral
    return ImuSample(stamp, rate, forward, lateral, heading, variance)


def magnetic_from_message(message: Any, mount_heading: float = 0.0) -> MagneticSample | Refusal:
    """Return the field in base_link axes; `mount_heading` as for `imu_from_message`."""
    stamp = stamp_from_message(message.header.stamp)
    field = message.magnetic_field
    if not (math.isfinite(field.x) and math.isfinite(field.y) and math.isfinite(field.z)):
        return Refusal(stamp, MAGNETIC_SOURCE, '', 'field is not finite')
    cos, sin = math.cos(mount_heading), math.sin(mount_heading)
    return MagneticSample(
        stamp, cos * field.x - sin * field.y, sin * field.x + cos * field.y, field.z
    )
