"""A planned way: a polyline in the map with an arc length."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tablerunner.types import Vector


@dataclass(frozen=True, eq=False)
class Path:
    """A way over the floor.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Corners in map [m], start first; at least one, neighbours apart from each other.
    heading : float or None
        Heading to take at the end [rad]; None: any.
    arc : ndarray, shape (n,)
        Length along the path up to each corner [m].
    """

    points: Vector
    heading: float | None = None
    arc: Vector = field(init=False)

    def __post_init__(self) -> None:
        """Drop repeated corners and measure the path."""
        points = np.asarray(self.points, dtype=float).reshape(-1, 2)
        if len(points) == 0 or not np.all(np.isfinite(points)):
            raise ValueError('a path needs at least one point, all finite')
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        points = points[np.concatenate([[True], step > 1e-9])]
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        object.__setattr__(self, 'points', points)
        object.__setattr__(self, 'arc', np.concatenate([[0.0], np.cumsum(step)]))

    @property
    def length(self) -> float:
        """Length of the whole path [m]."""
        return float(self.arc[-1])

    @property
    def end(self) -> tuple[float, float]:
        """Where it leads [m]."""
        return float(self.points[-1, 0]), float(self.points[-1, 1])

    def at(self, arc: float) -> Vector:
        """Return the point at a length along the path, shape (2,); the ends beyond the ends."""
        return np.array(
            [np.interp(arc, self.arc, self.points[:, axis]) for axis in (0, 1)], dtype=float
        )

    def project(
        self, x: float, y: float, low: float = 0.0, high: float = np.inf
    ) -> tuple[float, float]:
        """Return (arc, distance) of the nearest point of the path between two lengths.

        The window ``low <= arc <= high`` keeps a robot from jumping to another leg of a path that
        passes by itself.
        """
        here = np.array([x, y])
        if len(self.points) == 1:
            return 0.0, float(np.linalg.norm(self.points[0] - here))
        start, along = self.points[:-1], np.diff(self.points, axis=0)
        length = np.diff(self.arc)
        share = np.sum((here - start) * along, axis=1) / length**2
        first = np.clip((low - self.arc[:-1]) / length, 0.0, 1.0)
        last = np.clip((high - self.arc[:-1]) / length, 0.0, 1.0)
        share = np.clip(share, first, last)
        distance = np.linalg.norm(start + share[:, None] * along - here, axis=1)
        outside = (self.arc[1:] < low - 1e-9) | (self.arc[:-1] > high + 1e-9)
        best = int(np.argmin(np.where(outside, np.inf, distance)))
        return float(self.arc[best] + share[best] * length[best]), float(distance[best])

    def resampled(self, spacing: float) -> Vector:
        """Return points at most `spacing` [m] apart along the path, corners kept, (m, 2)."""
        count = max(int(np.ceil(self.length / spacing)), 1)
        arcs = np.union1d(np.linspace(0.0, self.length, count + 1), self.arc)
        return np.column_stack([np.interp(arcs, self.arc, self.points[:, k]) for k in (0, 1)])
