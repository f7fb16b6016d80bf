"""Where a round robot can go in a room: a flood fill on a raster.

Made from the outlines alone and with code of its own, so that what the planner believes to be
reachable can be held against it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablerunner.scenario import Outline

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Point = tuple[float, float]

CELL_M = 0.025


class RoomGrid:
    """Distances to what stands in a room, on a raster; good to about one cell.

    Parameters
    ----------
    size_m : tuple of float
        The room reaches from (0, 0) to here.
    outlines : sequence of Outline
        What the robot's map shows.
    unknown : sequence of Outline
        What it does not show.
    circles : sequence of (x, y, radius)
        More of that: people who stand.
    """

    def __init__(
        self,
        size_m: tuple[float, float],
        outlines: tuple[Outline, ...],
        unknown: tuple[Outline, ...] = (),
        circles: tuple[tuple[float, float, float], ...] = (),
    ) -> None:
        self.size_m = size_m
        self._shape = tuple(math.ceil(side / CELL_M) + 1 for side in size_m)
        self.known = self._distances(outlines)
        self.unknown = self._distances(unknown, circles)

    def _distances(
        self,
        outlines: tuple[Outline, ...],
        circles: tuple[tuple[float, float, float], ...] = (),
    ) -> Array:
        """Return the distance of each cell to the nearest of these things [m]."""
        taken = np.zeros(self._shape, dtype=bool)
        for outline in outlines:
            for start, end in outline.segments:
                count = int(np.linalg.norm(end - start) / (0.4 * CELL_M)) + 2
                points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
                cells = np.round(points / CELL_M).astype(int)
                cells = cells[np.all((cells >= 0) & (cells < self._shape), axis=1)]
                taken[cells[:, 0], cells[:, 1]] = True
            if outline.is_solid:
                taken |= self._inside(outline)
        if circles:
            xs, ys = self._axes()
            for x, y, radius in circles:
                taken |= (xs - x) ** 2 + (ys - y) ** 2 <= radius**2
        if not taken.any():
            return np.full(self._shape, np.inf)
        return np.asarray(ndimage.distance_transform_edt(~taken, sampling=CELL_M))

    def _axes(self) -> tuple[Array, Array]:
        xs, ys = (CELL_M * np.arange(count, dtype=float) for count in self._shape)
        return xs[:, None], ys[None, :]

    def _inside(self, outline: Outline) -> Mask:
        inside = np.zeros(self._shape, dtype=bool)
        low = np.maximum(np.floor(outline.corners.min(axis=0) / CELL_M).astype(int), 0)
        high = np.ceil(outline.corners.max(axis=0) / CELL_M).astype(int) + 1
        window = tuple(slice(a, min(b, n)) for a, b, n in zip(low, high, self._shape, strict=True))
        xs, ys = self._axes()
        x, y = np.broadcast_arrays(xs[window[0]], ys[:, window[1]])
        points = np.column_stack([x.ravel(), y.ravel()])
        inside[window] = outline.contains(points).reshape(x.shape)
        return inside

    def free(self, known_m: float, unknown_m: float) -> Mask:
        """Return where a disc's centre can be that needs so much space, shape (nx, ny)."""
        return np.asarray((self.known >= known_m) & (self.unknown >= unknown_m))

    def cell(self, point: Point) -> tuple[int, int]:
        """Return the cell of a point in map [m]."""
        return round(point[0] / CELL_M), round(point[1] / CELL_M)

    def space_at(self, point: Point) -> float:
        """Return the distance of a point to the nearest thing [m]."""
        cell = self.cell(point)
        return float(min(self.known[cell], self.unknown[cell]))

    def joined(self, start: Point, ends: tuple[Point, ...], free: Mask) -> tuple[bool, ...]:
        """Return which of the ends can be reached from the start over free cells."""
        labels, _ = ndimage.label(free)
        first = labels[self.cell(start)]
        return tuple(bool(first and labels[self.cell(end)] == first) for end in ends)

    def line_is_free(self, start: Point, end: Point, space_m: float) -> bool:
        """Return whether a straight line keeps so far from everything."""
        a, b = np.array(start), np.array(end)
        count = int(np.linalg.norm(b - a) / CELL_M) + 2
        points = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
        cells = np.round(points / CELL_M).astype(int)
        at = cells[:, 0], cells[:, 1]
        return bool(np.all(self.known[at] >= space_m) and np.all(self.unknown[at] >= space_m))

    def draw(self, rng: np.random.Generator, free: Mask) -> Point | None:
        """Return the middle of a free cell at random; None: there is none."""
        cells = np.flatnonzero(free)
        if not len(cells):
            return None
        column, row = divmod(int(cells[rng.integers(len(cells))]), self._shape[1])
        return round(column * CELL_M, 3), round(row * CELL_M, 3)
