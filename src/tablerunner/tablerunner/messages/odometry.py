"""Odometry: nav_msgs/Odometry as OdometrySample."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.geometry.pose import Pose2
from tablerunner.messages.covariance import (
    is_covariance,
    pose_covariance_from_message,
    twist_covariance_from_message,
)
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import OdometrySample, Refusal


def odometry_from_message(
    message: Any, frame: str = '', child: str = '', source: str = 'odom'
) -> OdometrySample | Refusal:
    """Return the odometry of a message; `frame` and `child` are those expected, empty for any."""
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    if child and message.child_frame_id != child:
        return Refusal(stamp, source, '', f'not of frame {child}')
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    pose = Pose2(place.x, place.y, heading_from_quaternion(turn))
    if not pose.is_finite:
        return Refusal(stamp, source, '', quaternion_fault(turn) or 'position is not finite')
    linear, angular = message.twist.twist.linear.x, message.twist.twist.angular.z
    if not (math.isfinite(linear) and math.isfinite(angular)):
        return Refusal(stamp, source, '', 'velocity is not finite')
    pose_covariance = pose_covariance_from_message(message.pose.covariance)
    twist_covariance = twist_covariance_from_message(message.twist.covariance)
    if not (is_covariance(pose_covariance) and is_covariance(twist_covariance)):
        return Refusal(stamp, source, '', 'covariance is not one')
    return OdometrySample(stamp, pose, linear, angular, pose_covariance, twist_covariance)
