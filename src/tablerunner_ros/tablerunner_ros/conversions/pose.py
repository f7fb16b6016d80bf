"""Poses: PoseWithCovarianceStamped and PoseSample, PoseStamped and nav_msgs/Path and Pose2."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path

from tablerunner.geometry.pose import Pose2
from tablerunner.messages.covariance import pose_covariance_to_message
from tablerunner.messages.pose import (
    goal_from_message,
    path_from_message,
    pose2_from_message,
    pose_from_message,
)
from tablerunner.types import PoseSample
from tablerunner_ros.conversions.quaternion import fill_quaternion
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = [
    'fill_pose',
    'fill_pose_with_covariance',
    'goal_from_message',
    'goal_to_message',
    'path_from_message',
    'path_to_message',
    'pose2_from_message',
    'pose_from_message',
    'pose_to_message',
]


def fill_pose(message: PoseMessage, pose: Pose2) -> None:
    """Write a pose in the plane into a message."""
    message.position.x = pose.x
    message.position.y = pose.y
    fill_quaternion(message.orientation, pose.heading)


def pose_to_message(sample: PoseSample, frame: str) -> PoseWithCovarianceStamped:
    """Return a pose with covariance as a message."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    fill_pose_with_covariance(message, sample.stamp, sample.pose, sample.covariance)
    return message


def fill_pose_with_covariance(
    message: PoseWithCovarianceStamped,
    stamp: int,
    pose: Pose2,
    covariance: np.ndarray,
) -> None:
    """Write stamp [ns], pose and its covariance (3, 3) into a message that has its frame."""
    fill_stamp(message.header.stamp, stamp)
    fill_pose(message.pose.pose, pose)
    message.pose.covariance = pose_covariance_to_message(covariance)


def goal_to_message(pose: Pose2, stamp: int, frame: str) -> PoseStamped:
    """Return a pose without covariance as a message."""
    message = PoseStamped()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    fill_pose(message.pose, pose)
    return message


def path_to_message(poses: Iterable[Pose2], stamp: int, frame: str) -> Path:
    """Return poses as a path."""
    message = Path()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    message.poses = [goal_to_message(pose, stamp, frame) for pose in poses]
    return message
