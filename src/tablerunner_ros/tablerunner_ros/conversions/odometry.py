"""Odometry: nav_msgs/Odometry and OdometrySample (wheels) or Estimate (fusion)."""

from __future__ import annotations

import math

from nav_msgs.msg import Odometry

from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, Refusal
from tablerunner_ros.conversions.covariance import (
    is_covariance,
    pose_covariance_from_message,
    pose_covariance_to_message,
    twist_covariance_from_message,
    twist_covariance_to_message,
)
from tablerunner_ros.conversions.quaternion import (
    fill_quaternion,
    heading_from_quaternion,
    quaternion_fault,
)
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message


def odometry_from_message(
    message: Odometry, frame: str = '', child: str = '', source: str = 'odom'
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


def odometry_to_message(sample: OdometrySample, frame: str, child: str) -> Odometry:
    """Return odometry as a message."""
    message = Odometry()
    message.header.frame_id = frame
    message.child_frame_id = child
    fill_odometry(message, sample)
    return message


def fill_odometry(message: Odometry, sample: OdometrySample) -> None:
    """Write odometry into a message that has its frames already."""
    fill_stamp(message.header.stamp, sample.stamp)
    pose = message.pose.pose
    pose.position.x = sample.pose.x
    pose.position.y = sample.pose.y
    fill_quaternion(pose.orientation, sample.pose.heading)
    message.pose.covariance = pose_covariance_to_message(sample.pose_covariance)
    message.twist.twist.linear.x = sample.linear_m_s
    message.twist.twist.angular.z = sample.angular_rad_s
    message.twist.covariance = twist_covariance_to_message(sample.twist_covariance)
