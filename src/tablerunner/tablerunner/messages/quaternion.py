"""Quaternions: geometry_msgs/Quaternion as heading in the plane."""

from __future__ import annotations

import math
from typing import Any

NORM_TOLERANCE = 0.01
"""How far the length of a quaternion may be from one: single precision and a few digits of text
stay well inside."""


def heading_from_quaternion(message: Any) -> float:
    """Return the heading (yaw, of z-y'-x'') [rad] in [-pi, pi]; NaN where it has none.

    A quaternion that is not finite or not of unit length has none; `quaternion_fault` says why.
    """
    x, y, z, w = message.x, message.y, message.z, message.w
    norm = x * x + y * y + z * z + w * w
    if not abs(norm - 1.0) < 2.0 * NORM_TOLERANCE:
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion_fault(message: Any) -> str:
    """Return why a quaternion has no heading; empty when it has one."""
    parts = (message.x, message.y, message.z, message.w)
    if not all(math.isfinite(part) for part in parts):
        return 'orientation is not finite'
    if all(part == 0.0 for part in parts):
        return 'orientation is an empty quaternion'
    if math.isnan(heading_from_quaternion(message)):
        return 'orientation is not a unit quaternion'
    return ''
