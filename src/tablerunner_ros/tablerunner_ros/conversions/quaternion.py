"""Quaternions of messages and headings in the plane."""

from __future__ import annotations

import math

from geometry_msgs.msg import Quaternion

from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault

__all__ = [
    'fill_quaternion',
    'heading_from_quaternion',
    'heading_to_quaternion',
    'quaternion_fault',
]


def heading_to_quaternion(heading: float) -> Quaternion:
    """Return the quaternion of a heading [rad]."""
    message = Quaternion()
    fill_quaternion(message, heading)
    return message


def fill_quaternion(message: Quaternion, heading: float) -> None:
    """Write a heading [rad] into a quaternion; x and y are taken to be zero already."""
    message.z = math.sin(0.5 * heading)
    message.w = math.cos(0.5 * heading)
