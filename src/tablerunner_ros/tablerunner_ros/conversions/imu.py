"""Inertial units: sensor_msgs/Imu and ImuSample, sensor_msgs/MagneticField and MagneticSample."""

from __future__ import annotations

import math

from sensor_msgs.msg import Imu, MagneticField

from tablerunner.geometry.angles import wrap
from tablerunner.types import ImuSample, MagneticSample, Refusal
from tablerunner_ros.conversions.quaternion import (
    fill_quaternion,
    heading_from_quaternion,
    quaternion_fault,
)
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

IMU_SOURCE = 'imu/data'
MAGNETIC_SOURCE = 'imu/mag'


def imu_from_message(message: Imu, mount_heading: float = 0.0) -> ImuSample | Refusal:
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


def imu_to_message(sample: ImuSample, frame: str) -> Imu:
    """Return a sample as a message of an IMU that is mounted along base_link."""
    message = Imu()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
    message.angular_velocity.z = sample.yaw_rate_rad_s
    message.angular_velocity_covariance[8] = sample.yaw_rate_variance
    if math.isnan(sample.yaw_rad):
        message.orientation_covariance[0] = -1.0
    else:
        fill_quaternion(message.orientation, sample.yaw_rad)
    if math.isnan(sample.forward_acceleration_m_s2):
        message.linear_acceleration_covariance[0] = -1.0
    else:
        message.linear_acceleration.x = sample.forward_acceleration_m_s2
        message.linear_acceleration.y = sample.lateral_acceleration_m_s2
    return message


def magnetic_from_message(
    message: MagneticField, mount_heading: float = 0.0
) -> MagneticSample | Refusal:
    """Return the field in base_link axes; `mount_heading` as for `imu_from_message`."""
    stamp = stamp_from_message(message.header.stamp)
    field = message.magnetic_field
    if not (math.isfinite(field.x) and math.isfinite(field.y) and math.isfinite(field.z)):
        return Refusal(stamp, MAGNETIC_SOURCE, '', 'field is not finite')
    cos, sin = math.cos(mount_heading), math.sin(mount_heading)
    return MagneticSample(
        stamp, cos * field.x - sin * field.y, sin * field.x + cos * field.y, field.z
    )


def magnetic_to_message(sample: MagneticSample, frame: str) -> MagneticField:
    """Return a sample as a message of a magnetometer that is mounted along base_link."""
    message = MagneticField()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
    message.magnetic_field.x = sample.field_x_t
    message.magnetic_field.y = sample.field_y_t
    message.magnetic_field.z = sample.field_z_t
    return message
