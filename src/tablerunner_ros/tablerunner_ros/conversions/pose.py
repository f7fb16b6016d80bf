"""Poses: PoseWithCovarianceStamped and PoseSample, PoseStamped and nav_msgs/Path and Pose2."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import Path

from tablerunner.geometry.pose import Pose2
from tablerunner.types import UNKNOWN_YAW_VARIANCE, PoseSample, Refusal
from tablerunner_ros.conversions.covariance import (
    is_covariance,
    pose_covariance_from_message,
    pose_covariance_to_message,
)
from tablerunner_ros.conversions.quaternion import (
    fill_quaternion,
    heading_from_quaternion,
    quaternion_fault,
)
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

_UNKNOWN = UNKNOWN_YAW_VARIANCE * (1.0 - 1e-9)


def pose2_from_message(message: PoseMessage) -> Pose2 | str:
    """Return a pose in the plane, or the reason why there is none."""
    pose = Pose2(
        message.position.x, message.position.y, heading_from_quaternion(message.orientation)
    )
    if pose.is_finite:
        return pose
    return quaternion_fault(message.orientation) or 'position is not finite'


def fill_pose(message: PoseMessage, pose: Pose2) -> None:
    """Write a pose in the plane into a message."""
    message.position.x = pose.x
    message.position.y = pose.y
    fill_quaternion(message.orientation, pose.heading)


def pose_from_message(
    message: PoseWithCovarianceStamped, frame: str, source: str
) -> PoseSample | Refusal:
    """Return a pose with covariance; a heading of which nothing is known has variance inf.

    Parameters
    ----------
    message : geometry_msgs.msg.PoseWithCovarianceStamped
        From RViz, the camera or a UWB fix.
    frame : str
        The frame that is expected; empty for any.
    source : str
        Topic it came from.
    """
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    pose = pose2_from_message(message.pose.pose)
    if isinstance(pose, str):
        return Refusal(stamp, source, '', pose)
    covariance = pose_covariance_from_message(message.pose.covariance)
    if not is_covariance(covariance):
        return Refusal(stamp, source, '', 'covariance is not one')
    if covariance[2, 2] >= _UNKNOWN:
        covariance[2, :] = covariance[:, 2] = 0.0
        covariance[2, 2] = math.inf
    return PoseSample(stamp, pose, covariance, source)


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


def goal_from_message(
    message: PoseStamped, frame: str, source: str = 'goal_pose'
) -> Pose2 | Refusal:
    """Return a goal; `frame` is the one expected, empty for any."""
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    pose = pose2_from_message(message.pose)
    return Refusal(stamp, source, '', pose) if isinstance(pose, str) else pose


def goal_to_message(pose: Pose2, stamp: int, frame: str) -> PoseStamped:
    """Return a pose without covariance as a message."""
    message = PoseStamped()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    fill_pose(message.pose, pose)
    return message


def path_from_message(
    message: Path, frame: str, source: str = 'waypoints'
) -> tuple[Pose2, ...] | Refusal:
    """Return the poses of a path; each may leave its frame empty or must name the path's own."""
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    if not message.poses:
        return Refusal(stamp, source, '', 'path is empty')
    poses = []
    for item in message.poses:
        own = frame if item.header.frame_id else ''
        pose = goal_from_message(item, own, source)
        if isinstance(pose, Refusal):
            return pose
        poses.append(pose)
    return tuple(poses)


def path_to_message(poses: Iterable[Pose2], stamp: int, frame: str) -> Path:
    """Return poses as a path."""
    message = Path()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    message.poses = [goal_to_message(pose, stamp, frame) for pose in poses]
    return message
