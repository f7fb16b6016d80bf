"""What an anchor at a known place reads: the distance to the tag, and its bias.

h = (1 + k) |p(t - d) + R(heading(t - d)) l - a| + bias, in three dimensions, with p the base, l
the tag's lever arm, a the anchor, k and bias the anchor's own errors, and d the delay of the
stamps, over which the robot moved on with the velocity that it had. Heights count: anchors hang
well above the tag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

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
    jacobian, values = np.zeros(len(mean)), mean.tolist()
    tag = _tag(values, lever_arm, twist)
    return _range(values, tag, anchor, bias_index, jacobian), jacobian


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
    jacobian, values = np.zeros((len(anchors), len(mean))), mean.tolist()
    tag = _tag(values, lever_arm, twist)
    expected = [
        _range(values, tag, anchor, index, row)
        for (anchor, index), row in zip(anchors, jacobian, strict=True)
    ]
    return expected, jacobian


class _Tag(NamedTuple):
    """Where the tag was when the range was taken, seen from the base and in map."""

    x: float
    y: float
    z: float
    from_base_x: float
    from_base_y: float
    by_delay_x: float  # d(x)/d(delay) [m/s]
    by_delay_y: float


def _tag(values: list[float], lever_arm: Point3, twist: Twist) -> _Tag:
    # Plain floats: this runs for every range, and reading an array element costs ten times more.
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
    return _Tag(
        x + tag_x,
        y + tag_y,
        arm_z,
        tag_x,
        tag_y,
        sin * aside - cos * along,
        -sin * along - cos * aside,
    )


def _range(values: list[float], tag: _Tag, anchor: Point3, index: int, jacobian: Vector) -> float:
    """Return the expected range; fill the Jacobian, which is zero before."""
    tag_x, tag_y, tag_z, from_base_x, from_base_y, by_delay_x, by_delay_y = tag
    dx, dy, dz = tag_x - anchor[0], tag_y - anchor[1], tag_z - anchor[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    bias, scale = RANGE_BIAS + index, range_scale(len(values)) + index
    grown = 1.0 + values[scale]
    if distance > NEAREST_M:
        ux, uy = grown * dx / distance, grown * dy / distance
        jacobian[X] = ux
        jacobian[Y] = uy
        jacobian[HEADING] = uy * from_base_x - ux * from_base_y
        jacobian[RANGE_DELAY] = ux * by_delay_x + uy * by_delay_y
    jacobian[bias] = 1.0
    jacobian[scale] = distance
    return grown * distance + values[bias]


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
