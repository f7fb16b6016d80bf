"""A planned way: a polyline in the map with an arc length."""

from __future__ import annotations

import math
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
    _legs: list[tuple[float, float, float, float, float, float]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Drop repeated corners and measure the path."""
        points = np.asarray(self.points, dtype=float).reshape(-1, 2)
        if len(points) == 0 or not np.all(np.isfinite(points)):
            raise ValueError('a path needs at least one point, all finite')
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        points = points[np.concatenate([[True], step > 1e-9])]
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        object.__setattr__(self, 'points', points)
        arc = np.concatenate([[0.0], np.cumsum(step)])
        object.__setattr__(self, 'arc', arc)
        legs = np.column_stack([points[:-1], np.diff(points, axis=0), arc[:-1], np.diff(arc)])
        object.__setattr__(self, '_legs', [tuple(leg) for leg in legs.tolist()])

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
        best, best_arc = math.inf, 0.0
        # In plain numbers: a path has few corners, and this is asked several times a step.
        for x0, y0, along_x, along_y, begin, length in self._legs:
            first, last = low - begin, high - begin
            if length < first - 1e-9 or last < -1e-9:
                continue
            along = ((x - x0) * along_x + (y - y0) * along_y) / length
            along = min(max(along, first, 0.0), max(min(last, length), 0.0), length)
            share = along / length
            away = math.hypot(x0 + share * along_x - x, y0 + share * along_y - y)
            if away < best:
                best, best_arc = away, begin + along
        if best == math.inf:
            return self._nearest_end(x, y, low)
        return best_arc, best

    def _nearest_end(self, x: float, y: float, low: float) -> tuple[float, float]:
        """Return (arc, distance) of the start, or of the end where the window lies beyond it."""
        index = 0 if len(self.points) == 1 or low <= 0.0 else -1
        there = self.points[index]
        return float(self.arc[index]), math.hypot(float(there[0]) - x, float(there[1]) - y)

    def resampled(self, spacing: float) -> Vector:
        """Return points at most `spacing` [m] apart along the path, corners kept, (m, 2)."""
        count = max(int(np.ceil(self.length / spacing)), 1)
        arcs = np.union1d(np.linspace(0.0, self.length, count + 1), self.arc)
        return np.column_stack([np.interp(arcs, self.arc, self.points[:, k]) for k in (0, 1)])
