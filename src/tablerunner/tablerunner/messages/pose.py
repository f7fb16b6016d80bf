"""Poses: PoseWithCovarianceStamped as PoseSample, PoseStamped and nav_msgs/Path as Pose2."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.geometry.pose import Pose2
from tablerunner.messages.covariance import is_covariance, pose_covariance_from_message
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import UNKNOWN_YAW_VARIANCE, PoseSample, Refusal

_UNKNOWN = UNKNOWN_YAW_VARIANCE * (1.0 - 1e-9)


def pose2_from_message(message: Any) -> Pose2 | str:
    """Return a pose in the plane, or the reason why there is none."""
    pose = Pose2(
        message.position.x, message.position.y, heading_from_quaternion(message.orientation)
    )
    if pose.is_finite:
        return pose
    return quaternion_fault(message.orientation) or 'position is not finite'


def pose_from_message(message: Any, frame: str, source: str) -> PoseSample | Refusal:
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


def goal_from_message(message: Any, frame: str, source: str = 'goal_pose') -> Pose2 | Refusal:
    """Return a goal; `frame` is the one expected, empty for any."""
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    pose = pose2_from_message(message.pose)
    return Refusal(stamp, source, '', pose) if isinstance(pose, str) else pose


def path_from_message(
    message: Any, frame: str, source: str = 'waypoints'
) -> tuple[Pose2, ...] | Refusal:
    """Return the poses of a path; each may leave its frame empty or must name the path's own."""
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, source, '', f'not in frame {frame}')
    if not len(message.poses):
        return Refusal(stamp, source, '', 'path is empty')
    poses = []
    for item in message.poses:
        own = frame if item.header.frame_id else ''
        pose = goal_from_message(item, own, source)
        if isinstance(pose, Refusal):
            return pose
        poses.append(pose)
    return tuple(poses)
