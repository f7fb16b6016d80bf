"""Wheel encoders: sensor_msgs/JointState and WheelSample."""

from __future__ import annotations

import math

from sensor_msgs.msg import JointState

from tablerunner.messages.wheels import wheels_from_message
from tablerunner.types import WheelSample
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['wheels_from_message', 'wheels_to_message']


def wheels_to_message(sample: WheelSample, left_joint: str, right_joint: str) -> JointState:
    """Return angles and, where known, speeds of both wheels as a message."""
    message = JointState()
    fill_stamp(message.header.stamp, sample.stamp)
    message.name = [left_joint, right_joint]
    message.position = [sample.left_angle_rad, sample.right_angle_rad]
    if not (math.isnan(sample.left_speed_rad_s) or math.isnan(sample.right_speed_rad_s)):
        message.velocity = [sample.left_speed_rad_s, sample.right_speed_rad_s]
    return message
