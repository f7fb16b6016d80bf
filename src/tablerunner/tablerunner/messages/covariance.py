"""Covariances: 6 x 6 of messages (x, y, z, roll, pitch, yaw) and 3 x 3 in the plane.

What the plane does not have (z, roll, pitch) gets zero variance: the robot stands on the floor.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.types import UNKNOWN_YAW_VARIANCE, Matrix, Vector

_POSE = np.array([0, 1, 5, 6, 7, 11, 30, 31, 35])  # rows and columns x, y, yaw
_TWIST = np.array([0, 5, 30, 35])  # rows and columns of forward speed and turn rate
_YAW = 35


def pose_covariance_from_message(values: ArrayLike) -> Matrix:
    """Return the covariance of x, y, heading, shape (3, 3), of a message's 36 numbers."""
    return np.asarray(values, dtype=np.float64).take(_POSE).reshape(3, 3)


def pose_covariance_to_message(covariance: Matrix) -> Vector:
    """Return the 36 numbers of a covariance of x, y, heading; an infinite heading is cut.

    A variance of the heading that is infinite or beyond that of an unknown heading is written as
    `UNKNOWN_YAW_VARIANCE` with no correlation: a message must stay finite.
    """
    values = np.zeros(36)
    values[_POSE] = covariance.ravel()
    if not values[_YAW] < UNKNOWN_YAW_VARIANCE:
        values[[5, 11, 30, 31]] = 0.0
        values[_YAW] = UNKNOWN_YAW_VARIANCE
    return values


def twist_covariance_from_message(values: ArrayLike) -> Matrix:
    """Return the covariance of forward speed and turn rate, shape (2, 2)."""
    return np.asarray(values, dtype=np.float64).take(_TWIST).reshape(2, 2)


def twist_covariance_to_message(covariance: Matrix) -> Vector:
    """Return the 36 numbers of a covariance of forward speed and turn rate."""
    values = np.zeros(36)
    values[_TWIST] = covariance.ravel()
    return values


def is_covariance(matrix: Matrix) -> bool:
    """Return whether a small matrix is finite with no negative variance."""
    return bool(np.isfinite(matrix).all()) and bool((matrix.diagonal() >= 0.0).all())


def largest_deviations(covariance: Matrix) -> tuple[float, float]:
    """Return the largest standard deviations of position [m] and of heading [rad].

    `covariance` is of x, y, heading, shape (3, 3); that of the position lies along the long axis
    of its ellipse.
    """
    mean = (covariance[0, 0] + covariance[1, 1]) / 2
    half = (covariance[0, 0] - covariance[1, 1]) / 2
    largest = mean + math.hypot(half, covariance[0, 1])
    return math.sqrt(max(largest, 0.0)), math.sqrt(max(covariance[2, 2], 0.0))
