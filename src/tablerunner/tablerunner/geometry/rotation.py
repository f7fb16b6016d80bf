"""Rotations in space, as 3 x 3 matrices that turn a frame's vectors into its parent's."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Rotation = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]
"""x, y, z, w, of length one."""


def rotation_of_rpy(roll: float, pitch: float, yaw: float) -> Rotation:
    """Return the rotation of roll, pitch and yaw [rad] about the parent's fixed axes, as in URDF.

    R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_of_quaternion(quaternion: Quaternion) -> Rotation:
    """Return the rotation of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_of_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return roll, pitch and yaw [rad] about the parent's fixed axes as a quaternion."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def quaternion_of_rotation(rotation: Rotation) -> Quaternion:
    """Return a rotation as a unit quaternion x, y, z, w, w at least 0.

    The largest part is found first, so that nothing is divided by a small number.
    """
    trace = float(np.trace(rotation))
    squares = [1.0 + 2.0 * float(rotation[k, k]) - trace for k in range(3)]
    squares.append(1.0 + trace)
    largest = int(np.argmax(squares))
    parts = [0.0] * 4
    parts[largest] = 0.5 * math.sqrt(squares[largest])
    share = 0.25 / parts[largest]
    for k in range(3):
        after, last = (k + 1) % 3, (k + 2) % 3
        twist = float(rotation[last, after] - rotation[after, last])  # 4 w times part k
        if largest == 3:
            parts[k] = share * twist
        elif largest == k:
            parts[3] = share * twist
        else:
            parts[k] = share * float(rotation[k, largest] + rotation[largest, k])
    if parts[3] < 0.0:
        parts = [-part for part in parts]
    return parts[0], parts[1], parts[2], parts[3]


def is_rotation(matrix: Rotation) -> bool:
    """Return whether a 3 x 3 matrix is a rotation, to a part in a hundred."""
    if not np.isfinite(matrix).all():
        return False
    near = np.abs(matrix @ matrix.T - np.eye(3)).max() < 0.02
    return bool(near and np.linalg.det(matrix) > 0.0)
