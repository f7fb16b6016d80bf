"""Quaternions of messages and headings in the plane."""

from __future__ import annotations

import math

from geometry_msgs.msg import Quaternion

NORM_TOLERANCE = 0.01
"""How far the length of a quaternion may be from one: single precision and a few digits of text
stay well inside."""


def heading_from_quaternion(message: Quaternion) -> float:
    """Return the heading (yaw, of z-y'-x'') [rad] in [-pi, pi]; NaN where it has none.

    A quaternion that is not finite or not of unit length has none; `quaternion_fault` says why.
    """
    x, y, z, w = message.x, message.y, message.z, message.w
    norm = x * x + y * y + z * z + w * w
    if not abs(norm - 1.0) < 2.0 * NORM_TOLERANCE:
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion_fault(message: Quaternion) -> str:
    """Return why a quaternion has no heading; empty when it has one."""
    parts = (message.x, message.y, message.z, message.w)
    if not all(math.isfinite(part) for part in parts):
        return 'orientation is not finite'
    if all(part == 0.0 for part in parts):
        return 'orientation is an empty quaternion'
    if math.isnan(heading_from_quaternion(message)):
        return 'orientation is not a unit quaternion'
    return ''


def heading_to_quaternion(heading: float) -> Quaternion:
    """Return the quaternion of a heading [rad]."""
    message = Quaternion()
    fill_quaternion(message, heading)
    return message


def fill_quaternion(message: Quaternion, heading: float) -> None:
    """Write a heading [rad] into a quaternion; x and y are taken to be zero already."""
    message.z = math.sin(0.5 * heading)
    message.w = math.cos(0.5 * heading)
