"""Inertial units: sensor_msgs/Imu as ImuSample, sensor_msgs/MagneticField as MagneticSample."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.rotation import Rotation, rotation_of_quaternion
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import ImuSample, MagneticSample, Refusal

IMU_SOURCE = 'imu/data'
MAGNETIC_SOURCE = 'imu/mag'

_UPRIGHT = 1e-9  # of the cosine of the tilt


def imu_from_message(
    message: Any, mount_heading: float = 0.0, mount: Rotation | None = None
) -> ImuSample | Refusal:
    """Return what a robot on a flat floor uses of an IMU.

    A first covariance element of -1 means "not measured", as sensor_msgs/Imu defines. An
    orientation of all zeros is taken for one that is not measured too: many drivers of gyroscopes
    leave it so, and no orientation looks like it.

    Parameters
    ----------
    message : sensor_msgs.msg.Imu
        In the IMU's own frame.
    mount_heading : float
        Heading of the IMU's frame in base_link [rad], its z axis upward.
    mount : ndarray, shape (3, 3), optional
        Rotation of the IMU's vectors into base_link, for any other mounting; `mount_heading`
        counts for nothing then.
    """
    stamp = stamp_from_message(message.header.stamp)
    rate_variance = message.angular_velocity_covariance
    if rate_variance[0] == -1.0:
        return Refusal(stamp, IMU_SOURCE, '', 'gives no angular velocity')
    upright = mount is None or abs(mount[2, 2] - 1.0) < _UPRIGHT
    if mount is not None and upright:
        mount_heading = math.atan2(mount[1, 0], mount[0, 0])
    turn = message.angular_velocity
    if mount is None or upright:
        rate, variance = turn.z, float(rate_variance[8])
    else:
        up = mount[2]
        rate = float(up @ (turn.x, turn.y, turn.z))
        variance = float(up @ np.reshape(rate_variance, (3, 3)) @ up)
    if not math.isfinite(rate):
        return Refusal(stamp, IMU_SOURCE, '', 'turn rate is not finite')
    if not (math.isfinite(variance) and variance >= 0.0):
        return Refusal(stamp, IMU_SOURCE, '', 'variance is not a finite number of at least 0')
    heading = math.nan
    if message.orientation_covariance[0] != -1.0 and not _is_empty(message.orientation):
        heading = heading_from_quaternion(message.orientation)
        if math.isnan(heading):
            return Refusal(stamp, IMU_SOURCE, '', quaternion_fault(message.orientation))
        heading = wrap(heading - mount_heading)
        if mount is not None and not upright:
            heading = _heading_of_base(message.orientation, mount)
    forward = lateral = math.nan
    if message.linear_acceleration_covariance[0] != -1.0:
        felt = message.linear_acceleration
        forward, lateral = felt.x, felt.y
        if mount is not None and not upright:
            forward, lateral, _ = (float(row @ (felt.x, felt.y, felt.z)) for row in mount)
        elif mount_heading:
            cos, sin = math.cos(mount_heading), math.sin(mount_heading)
            forward, lateral = cos * forward - sin * lateral, sin * forward + cos * lateral
    return ImuSample(stamp, rate, forward, lateral, heading, variance)


def _is_empty(quaternion: Any) -> bool:
    parts = (quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    return all(part == 0.0 for part in parts)


def _heading_of_base(orientation: Any, mount: Rotation) -> float:
    """Return the heading of base_link [rad] by the orientation of an IMU mounted on it."""
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    turned = rotation_of_quaternion(quaternion) @ mount.T
    return math.atan2(turned[1, 0], turned[0, 0])


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
