"""Wheel encoders: sensor_msgs/JointState and WheelSample."""

from __future__ import annotations

import math

from sensor_msgs.msg import JointState

from tablerunner.types import Refusal, WheelSample
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

SOURCE = 'joint_states'


def wheels_from_message(
    message: JointState, left_joint: str, right_joint: str
) -> WheelSample | Refusal:
    """Return angles and speeds of both drive wheels, found by the names of their joints."""
    stamp = stamp_from_message(message.header.stamp)
    names = message.name
    try:
        left, right = names.index(left_joint), names.index(right_joint)
    except ValueError:
        missing = left_joint if left_joint not in names else right_joint
        return Refusal(stamp, SOURCE, missing, 'joint is missing')
    angles, speeds = message.position, message.velocity
    if len(angles) != len(names):
        return Refusal(stamp, SOURCE, '', 'names and positions differ in number')
    if not (math.isfinite(angles[left]) and math.isfinite(angles[right])):
        return Refusal(stamp, SOURCE, '', 'wheel angle is not finite')
    if len(speeds) != len(names):
        if speeds:
            return Refusal(stamp, SOURCE, '', 'names and velocities differ in number')
        return WheelSample(stamp, angles[left], angles[right])
    return WheelSample(stamp, angles[left], angles[right], speeds[left], speeds[right])


def wheels_to_message(sample: WheelSample, left_joint: str, right_joint: str) -> JointState:
    """Return angles and, where known, speeds of both wheels as a message."""
    message = JointState()
    fill_stamp(message.header.stamp, sample.stamp)
    message.name = [left_joint, right_joint]
    message.position = [sample.left_angle_rad, sample.right_angle_rad]
    if not (math.isnan(sample.left_speed_rad_s) or math.isnan(sample.right_speed_rad_s)):
        message.velocity = [sample.left_speed_rad_s, sample.right_speed_rad_s]
    return message
