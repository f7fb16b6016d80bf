"""Wheel encoders: sensor_msgs/JointState as WheelSample."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Refusal, WheelSample

SOURCE = 'joint_states'
LEFT_JOINT = 'left_wheel_joint'
RIGHT_JOINT = 'right_wheel_joint'
"""Names of the drive wheels' joints unless a parameter says otherwise."""


def wheels_from_message(message: Any, left_joint: str, right_joint: str) -> WheelSample | Refusal:
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
    left_angle, right_angle = float(angles[left]), float(angles[right])
    if not (math.isfinite(left_angle) and math.isfinite(right_angle)):
        return Refusal(stamp, SOURCE, '', 'wheel angle is not finite')
    if len(speeds) != len(names):
        if len(speeds):
            return Refusal(stamp, SOURCE, '', 'names and velocities differ in number')
        return WheelSample(stamp, left_angle, right_angle)
    return WheelSample(stamp, left_angle, right_angle, float(speeds[left]), float(speeds[right]))
