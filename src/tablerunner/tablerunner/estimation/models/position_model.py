"""Where a point of the robot is: the tag of a UWB fix, the marker under a camera.

h = p + R(heading) l, with p the base and l the point in base_link.
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.types import Matrix, Vector


def predict_position(mean: Vector, point: tuple[float, float]) -> tuple[Vector, Matrix]:
    """Return the expected position of a point of the robot and its Jacobian.

    Parameters
    ----------
    mean : ndarray, shape (n,)
        State that begins with x, y [m], heading [rad].
    point : tuple
        In base_link [m].

    Returns
    -------
    expected : ndarray, shape (2,)
        In map [m].
    jacobian : ndarray, shape (2, n)
        d(position)/d(state); units 1, 1, m/rad, 0 ...
    """
    cos, sin = math.cos(mean[2]), math.sin(mean[2])
    arm_x, arm_y = cos * point[0] - sin * point[1], sin * point[0] + cos * point[1]
    jacobian = np.zeros((2, len(mean)))
    jacobian[:, :3] = [[1.0, 0.0, -arm_y], [0.0, 1.0, arm_x]]
    return np.array([mean[0] + arm_x, mean[1] + arm_y]), jacobian
