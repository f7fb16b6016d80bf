"""What many poses should measure at once, with the Jacobians by x, y, heading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tablerunner.estimation.models.range_model import NEAREST_M, Point3
from tablerunner.estimation.particles.iterated import Array
from tablerunner.types import Matrix


def ranges_of(poses: Matrix, anchors: Sequence[Point3], lever_arm: Point3) -> tuple[Matrix, Array]:
    """Return the distances from the tag to m anchors, shape (n, m), and d/d(pose), (n, m, 3).

    Parameters
    ----------
    poses : ndarray, shape (n, 3)
        x, y [m], heading [rad] of base_link in map.
    anchors : sequence of m points
        In map [m].
    lever_arm : tuple
        Tag in base_link [m].
    """
    place, by_heading = _points(poses, lever_arm[:2])
    at = np.array(anchors)
    x, y = place[:, :1] - at[:, 0], place[:, 1:] - at[:, 1]
    distance = np.sqrt(x * x + y * y + (lever_arm[2] - at[:, 2]) ** 2)
    inverse = 1.0 / np.maximum(distance, NEAREST_M)
    slope = np.empty((*distance.shape, 3))
    slope[:, :, 0] = x = x * inverse
    slope[:, :, 1] = y = y * inverse
    slope[:, :, 2] = x * by_heading[:, :1] + y * by_heading[:, 1:]
    return distance, slope


def position_of(poses: Matrix, point: tuple[float, float]) -> tuple[Matrix, Array]:
    """Return where a point of the robot is, shape (n, 2) [m], and d/d(pose), (n, 2, 3).

    Parameters
    ----------
    poses : ndarray, shape (n, 3)
    point : tuple
        In base_link [m].
    """
    place, by_heading = _points(poses, point)
    slope = np.zeros((len(poses), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = 1.0
    slope[:, :, 2] = by_heading
    return place, slope


def _points(poses: Matrix, point: tuple[float, float]) -> tuple[Matrix, Matrix]:
    by_heading = np.zeros((len(poses), 2))
    if point[0] == 0.0 and point[1] == 0.0:
        return poses[:, :2], by_heading
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    by_heading[:, 1] = cos * point[0] - sin * point[1]
    by_heading[:, 0] = -sin * point[0] - cos * point[1]
    place = np.empty_like(by_heading)
    place[:, 0] = poses[:, 0] + by_heading[:, 1]
    place[:, 1] = poses[:, 1] - by_heading[:, 0]
    return place, by_heading
