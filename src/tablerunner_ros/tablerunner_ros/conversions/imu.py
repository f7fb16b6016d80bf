"""Inertial units: sensor_msgs/Imu and ImuSample, sensor_msgs/MagneticField and MagneticSample."""

from __future__ import annotations

import math

from sensor_msgs.msg import Imu, MagneticField

from tablerunner.messages.imu import imu_from_message, magnetic_from_message
from tablerunner.types import ImuSample, MagneticSample
from tablerunner_ros.conversions.quaternion import fill_quaternion
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = [
    'imu_from_message',
    'imu_to_message',
    'magnetic_from_message',
    'magnetic_to_message',
]


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


def magnetic_to_message(sample: MagneticSample, frame: str) -> MagneticField:
    """Return a sample as a message of a magnetometer that is mounted along base_link."""
    message = MagneticField()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
    message.magnetic_field.x = sample.field_x_t
    message.magnetic_field.y = sample.field_y_t
    message.magnetic_field.z = sample.field_z_t
    return message
