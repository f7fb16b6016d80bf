"""What an anchor at a known place reads: the distance to the tag, and its bias.

h = |p + R(heading) l - a| + bias, in three dimensions, with p the base, l the tag's lever arm, a
the anchor. Heights count: anchors hang well above the tag.
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.models.state import HEADING, RANGE_BIAS, X, Y
from tablerunner.types import Matrix, Vector

Point3 = tuple[float, float, float]

_NEAREST_M = 1e-6  # closer, the direction to the anchor is noise


def predict_range(
    mean: Vector, anchor: Point3, lever_arm: Point3, bias_index: int
) -> tuple[float, Vector]:
    """Return the expected range and its Jacobian.

    Parameters
    ----------
    mean : ndarray, shape (n,)
        State as in `models.state`.
    anchor : tuple
        Anchor in map [m].
    lever_arm : tuple
        Tag in base_link [m].
    bias_index : int
        Which of the range biases belongs to this anchor.

    Returns
    -------
    expected : float
        Range [m].
    jacobian : ndarray, shape (n,)
        d(range)/d(state); units 1, 1, m/rad, 0 ... 1. Zero towards an anchor that the tag touches.
    """
    # Plain floats: this runs for every range, and reading an array element costs ten times more.
    x, y, heading = mean[:3].tolist()
    cos, sin = math.cos(heading), math.sin(heading)
    arm_x = cos * lever_arm[0] - sin * lever_arm[1]
    arm_y = sin * lever_arm[0] + cos * lever_arm[1]
    dx, dy = x + arm_x - anchor[0], y + arm_y - anchor[1]
    distance = math.sqrt(dx * dx + dy * dy + (lever_arm[2] - anchor[2]) ** 2)
    jacobian = np.zeros(len(mean))
    if distance > _NEAREST_M:
        ux, uy = dx / distance, dy / distance
        jacobian[:3] = ux, uy, uy * arm_x - ux * arm_y
    jacobian[RANGE_BIAS + bias_index] = 1.0
    return distance + float(mean[RANGE_BIAS + bias_index]), jacobian


def predict_range_many(
    means: Matrix, anchor: Point3, lever_arm: Point3, bias_index: int
) -> Vector:
    """Return the expected range of many states at once [m], shape (k,).

    Parameters
    ----------
    means : ndarray, shape (k, n)
        States as in `models.state`.
    anchor, lever_arm, bias_index
        As for `predict_range`.
    """
    cos, sin = np.cos(means[:, HEADING]), np.sin(means[:, HEADING])
    dx = means[:, X] + cos * lever_arm[0] - sin * lever_arm[1] - anchor[0]
    dy = means[:, Y] + sin * lever_arm[0] + cos * lever_arm[1] - anchor[1]
    distance = np.sqrt(dx * dx + dy * dy + (lever_arm[2] - anchor[2]) ** 2)
    return np.asarray(distance + means[:, RANGE_BIAS + bias_index])
