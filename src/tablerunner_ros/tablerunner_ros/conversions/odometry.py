"""Odometry: nav_msgs/Odometry and OdometrySample (wheels) or Estimate (fusion)."""

from __future__ import annotations

from nav_msgs.msg import Odometry

from tablerunner.messages.covariance import (
    pose_covariance_to_message,
    twist_covariance_to_message,
)
from tablerunner.messages.odometry import odometry_from_message
from tablerunner.types import OdometrySample
from tablerunner_ros.conversions.quaternion import fill_quaternion
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['fill_odometry', 'odometry_from_message', 'odometry_to_message']


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
