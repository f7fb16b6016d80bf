"""Planar rigid motions, SE(2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.angles import wrap


@dataclass(frozen=True, slots=True)
class Pose2:
    """Position and heading of one frame in another: ``pose_map_base`` is base_link in map.

    Perturbed additively as (x, y, heading) in the parent frame, in that order, wherever a
    covariance is given.
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def __matmul__(self, other: Pose2) -> Pose2:
        """Return ``self`` followed by ``other`` (given in the frame of ``self``)."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return Pose2(
            self.x + cos * other.x - sin * other.y,
            self.y + sin * other.x + cos * other.y,
            wrap(self.heading + other.heading),
        )

    def inverse(self) -> Pose2:
        """Return the parent frame as seen from this one."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return Pose2(
            -cos * self.x - sin * self.y, sin * self.x - cos * self.y, wrap(-self.heading)
        )

    def between(self, other: Pose2) -> Pose2:
        """Return ``other`` as seen from ``self`` (both given in one parent frame)."""
        return self.inverse() @ other

    def transform(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of this frame, shape (..., 2), in the parent frame."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        rotation = np.array([[cos, -sin], [sin, cos]])
        return np.asarray(points @ rotation.T + np.array([self.x, self.y]))

    def distance_to(self, other: Pose2) -> float:
        """Return the distance between the two origins [m]."""
        return math.hypot(other.x - self.x, other.y - self.y)

    @property
    def is_finite(self) -> bool:
        """Whether all three numbers are finite."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.heading)
