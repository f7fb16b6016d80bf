"""The truth: nav_msgs/Odometry of ground_truth as stamp and pose."""

from __future__ import annotations

from typing import Any, NamedTuple

from tablerunner.geometry.pose import Pose2
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import UNKNOWN_YAW_VARIANCE, Refusal

SOURCE = 'ground_truth'
_UNKNOWN = UNKNOWN_YAW_VARIANCE * (1.0 - 1e-9)
_YAW = 35


class TruePose(NamedTuple):
    """Where the robot really was."""

    stamp: int
    pose: Pose2  # base_link in map
    heading_known: bool


def truth_from_message(message: Any) -> TruePose | Refusal:
    """Return the true pose; a variance of the heading beyond knowing means that it is unknown."""
    stamp = stamp_from_message(message.header.stamp)
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    pose = Pose2(place.x, place.y, heading_from_quaternion(turn))
    if not pose.is_finite:
        return Refusal(stamp, SOURCE, '', quaternion_fault(turn) or 'position is not finite')
    return TruePose(stamp, pose, bool(message.pose.covariance[_YAW] < _UNKNOWN))
