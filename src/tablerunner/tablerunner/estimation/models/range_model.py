"""What an anchor at a known place reads: the distance to the tag, and its bias.

h = (1 + k) |p(t - d) + R(heading(t - d)) l - a| + bias, in three dimensions, with p the base, l
the tag's lever arm, a the anchor, k and bias the anchor's own errors, and d the delay of the
stamps, over which the robot moved on with the velocity that it had. Heights count: anchors hang
well above the tag.
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.models.state import (
    HEADING,
    RANGE_BIAS,
    RANGE_DELAY,
    X,
    Y,
    range_scale,
)
from tablerunner.types import Matrix, Vector

Point3 = tuple[float, float, float]
Twist = tuple[float, float]
"""Forward speed [m/s] and turn rate [rad/s]."""

STANDING: Twist = (0.0, 0.0)

NEAREST_M = 1e-6  # closer, the direction to the anchor is noise


def predict_range(
    mean: Vector, anchor: Point3, lever_arm: Point3, bias_index: int, twist: Twist = STANDING
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
        Which of the range biases, and of the range scales, belongs to this anchor.
    twist : tuple
        Forward speed [m/s] and turn rate [rad/s] of base_link.

    Returns
    -------
    expected : float
        Range [m].
    jacobian : ndarray, shape (n,)
        d(range)/d(state); units 1, 1, m/rad, 0 ... m/s, 0 ... 1, 0 ... m. Zero towards an anchor
        that the tag touches.
    """
    # Plain floats: this runs for every range, and reading an array element costs ten times more.
    x, y, heading, _, _, _, delay = mean[:RANGE_BIAS].tolist()
    speed, turn_rate = twist
    cos, sin = math.cos(heading), math.sin(heading)
    # The tag, seen from the base now: where it was a delay ago. Along and across the heading.
    arm_x, arm_y, arm_z = lever_arm
    if delay and turn_rate:
        angle = -turn_rate * delay
        turned, across = math.cos(angle), math.sin(angle)
        arm_x, arm_y = turned * arm_x - across * arm_y, across * arm_x + turned * arm_y
    ahead = arm_x - speed * delay
    tag_x, tag_y = cos * ahead - sin * arm_y, sin * ahead + cos * arm_y
    dx, dy, dz = x + tag_x - anchor[0], y + tag_y - anchor[1], arm_z - anchor[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    size = len(mean)
    jacobian = np.zeros(size)
    row = range_scale(size) + bias_index
    grown = 1.0 + float(mean[row])
    if distance > NEAREST_M:
        ux, uy = grown * dx / distance, grown * dy / distance
        jacobian[X] = ux
        jacobian[Y] = uy
        jacobian[HEADING] = uy * tag_x - ux * tag_y
        # The tag moves with the base and round it; a delay takes it back.
        along, aside = speed - turn_rate * arm_y, turn_rate * arm_x
        jacobian[RANGE_DELAY] = -(
            ux * (cos * along - sin * aside) + uy * (sin * along + cos * aside)
        )
    jacobian[RANGE_BIAS + bias_index] = 1.0
    jacobian[row] = distance
    return grown * distance + float(mean[RANGE_BIAS + bias_index]), jacobian


def predict_range_many(
    means: Matrix,
    anchor: Point3,
    lever_arm: Point3,
    bias_index: int,
    twist: Twist = STANDING,
) -> Vector:
    """Return the expected range of many states at once [m], shape (k,).

    Parameters
    ----------
    means : ndarray, shape (k, n)
        States as in `models.state`.
    anchor, lever_arm, bias_index, twist
        As for `predict_range`.
    """
    delay, heading = means[:, RANGE_DELAY], means[:, HEADING]
    back = heading - twist[1] * delay
    cos, sin = np.cos(back), np.sin(back)
    dx = means[:, X] - twist[0] * delay * np.cos(heading) + cos * lever_arm[0] - sin * lever_arm[1]
    dy = means[:, Y] - twist[0] * delay * np.sin(heading) + sin * lever_arm[0] + cos * lever_arm[1]
    dz = lever_arm[2] - anchor[2]
    distance = np.sqrt((dx - anchor[0]) ** 2 + (dy - anchor[1]) ** 2 + dz**2)
    grown = 1.0 + means[:, range_scale(means.shape[1]) + bias_index]
    return np.asarray(grown * distance + means[:, RANGE_BIAS + bias_index])
