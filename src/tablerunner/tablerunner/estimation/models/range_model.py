"""What an anchor at a known place reads: the distance to the tag, and its bias.

h = (1 + k) |p(t - d) + R(heading(t - d)) l - a| + bias, in three dimensions, with p the base, l
the tag's lever arm, a the anchor, k and bias the anchor's own errors, and d the delay of the
stamps, over which the robot moved on with the velocity that it had. Heights count: anchors hang
well above the tag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

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
    expected, jacobian = predict_ranges(mean, ((anchor, bias_index),), lever_arm, twist)
    return expected[0], jacobian[0]


def predict_ranges(
    mean: Vector,
    anchors: Sequence[tuple[Point3, int]],
    lever_arm: Point3,
    twist: Twist = STANDING,
) -> tuple[list[float], Matrix]:
    """Return the ranges that several anchors should read at one instant, and their Jacobian.

    Parameters
    ----------
    mean, lever_arm, twist
        As for `predict_range`.
    anchors : sequence of (anchor, bias_index)
        As for `predict_range`, m of them.

    Returns
    -------
    expected : list of float
    jacobian : ndarray, shape (m, n)
    """
    size = len(mean)
    jacobian, values, expected = np.zeros((len(anchors), size)), mean.tolist(), []
    tag_x, tag_y, tag_z, from_base_x, from_base_y, by_delay_x, by_delay_y = _tag(
        values, lever_arm, twist
    )
    first_scale = range_scale(size)
    # Plain floats: reading an element of an array costs more than the arithmetic with it.
    for number, ((anchor_x, anchor_y, anchor_z), index) in enumerate(anchors):
        row = jacobian[number]
        dx, dy, dz = tag_x - anchor_x, tag_y - anchor_y, tag_z - anchor_z
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        bias, scale = RANGE_BIAS + index, first_scale + index
        grown = 1.0 + values[scale]
        if distance > NEAREST_M:
            ux, uy = grown * dx / distance, grown * dy / distance
            row[X] = ux
            row[Y] = uy
            row[HEADING] = uy * from_base_x - ux * from_base_y
            row[RANGE_DELAY] = ux * by_delay_x + uy * by_delay_y
        row[bias] = 1.0
        row[scale] = distance
        expected.append(grown * distance + values[bias])
    return expected, jacobian


def _tag(values: list[float], lever_arm: Point3, twist: Twist) -> tuple[float, ...]:
    """Return where the tag was when the range was taken, and how that hangs on the delay.

    x, y, z in map; x, y from the base, in map's directions; d(x)/d(delay), d(y)/d(delay) [m/s]. A
    plain tuple: names would cost as much as all cosines.
    """
    x, y, heading, delay = values[X], values[Y], values[HEADING], values[RANGE_DELAY]
    speed, turn_rate = twist
    cos, sin = math.cos(heading), math.sin(heading)
    # Along and across the heading.
    arm_x, arm_y, arm_z = lever_arm
    if delay and turn_rate:
        angle = -turn_rate * delay
        turned, across = math.cos(angle), math.sin(angle)
        arm_x, arm_y = turned * arm_x - across * arm_y, across * arm_x + turned * arm_y
    ahead = arm_x - speed * delay
    tag_x, tag_y = cos * ahead - sin * arm_y, sin * ahead + cos * arm_y
    # The tag moves with the base and round it; a delay takes it back.
    along, aside = speed - turn_rate * arm_y, turn_rate * arm_x
    return (
        x + tag_x,
        y + tag_y,
        arm_z,
        tag_x,
        tag_y,
        sin * aside - cos * along,
        -sin * along - cos * aside,
    )


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
