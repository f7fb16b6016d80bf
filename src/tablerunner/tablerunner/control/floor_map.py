"""How far every place of the room is from the nearest obstacle."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablerunner.errors import PlanningError
from tablerunner.geometry.segments import polygon_edges
from tablerunner.types import Vector

_MAX_CELLS = 4_000_000


@dataclass(frozen=True, slots=True)
class Disc:
    """A round obstacle: a round table, or a place where somebody stands."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, eq=False)
class FloorMap:
    """The room as a grid of distances.

    The distances are exact at the cell centres (computed from the geometry, not from a raster), so
    that the grid's spacing does not eat into narrow passages; inside a solid they are zero.

    Attributes
    ----------
    origin : ndarray, shape (2,)
        Centre of cell (0, 0) in map [m].
    resolution : float
        Spacing of the cells [m].
    distance : ndarray, shape (rows, columns)
        Distance of each cell centre to the nearest obstacle [m]; rows run along y.
    outside : ndarray of bool, shape (rows, columns)
        Cells that are connected with the border of the grid: outside a room with closed walls.
    unseen : ndarray, shape (rows, columns), or None
        Distance of each cell to where an obstacle may reach [m]; None: it is nowhere unknown.
    """

    origin: Vector
    resolution: float
    distance: Vector
    outside: NDArray[np.bool_] = field(repr=False)
    unseen: Vector | None = field(default=None, repr=False)

    @classmethod
    def build(
        cls,
        segments: Vector,
        polygons: tuple[Vector, ...] = (),
        discs: tuple[Disc, ...] = (),
        resolution: float = 0.05,
    ) -> FloorMap:
        """Make the map of a room.

        Parameters
        ----------
        segments : ndarray, shape (n, 2, 2)
            Walls and outlines [m]; at least one.
        polygons : tuple of ndarray, shape (k, 2)
            Corners of solids (tables), whose inside is not floor. Their edges count as obstacles.
        discs : tuple of Disc
            Round solids.
        resolution : float
            Spacing of the cells [m].

        Raises
        ------
        PlanningError
            There are no walls, or the room is too large for the resolution.
        """
        segments = np.asarray(segments, dtype=float).reshape(-1, 2, 2)
        edges = [polygon_edges(np.asarray(corners, dtype=float)) for corners in polygons]
        everything = np.concatenate([segments, *edges])
        if len(everything) == 0:
            raise PlanningError('the room has no walls: there is nothing to plan in')
        low = everything.min(axis=(0, 1)) - 2 * resolution
        high = everything.max(axis=(0, 1)) + 2 * resolution
        columns, rows = (int(n) + 1 for n in np.ceil((high - low) / resolution))
        if rows * columns > _MAX_CELLS:
            raise PlanningError(
                f'the room needs {rows} x {columns} cells of {resolution:g} m: use larger cells'
            )
        xs = low[0] + resolution * np.arange(columns)
        ys = low[1] + resolution * np.arange(rows)
        distance = _to_segments(xs, ys, everything)
        grid_x, grid_y = np.meshgrid(xs, ys)
        centres = np.column_stack([grid_x.ravel(), grid_y.ravel()])
        for corners in polygons:
            distance[_inside(centres, np.asarray(corners, dtype=float))] = 0.0
        distance = _with_discs(distance, centres, discs).reshape(rows, columns)
        # A wall is a line: the cells it runs through are those nearer than most of a spacing.
        labels, _ = ndimage.label(distance > 0.75 * resolution)
        return cls(low, resolution, distance, (labels == labels[0, 0]) & (labels > 0))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.distance.shape[0], self.distance.shape[1]

    def with_discs(self, discs: tuple[Disc, ...]) -> FloorMap:
        """Return the map with more round obstacles in it."""
        if not discs:
            return self
        distance = _with_discs(self.distance.ravel(), self.centres(), discs)
        return replace(self, distance=distance.reshape(self.shape))

    def at_ease(self, offset: float) -> FloorMap:
        """Return the map as one likes to drive on it.

        What may be an obstacle counts as one that is farther away by `offset` [m].
        """
        if self.unseen is None:
            return self
        return replace(self, distance=np.minimum(self.distance, self.unseen + offset))

    def centres(self) -> Vector:
        """Return the cell centres in map, shape (rows * columns, 2), row by row."""
        rows, columns = self.shape
        xs, ys = np.meshgrid(
            self.origin[0] + self.resolution * np.arange(columns),
            self.origin[1] + self.resolution * np.arange(rows),
        )
        return np.column_stack([xs.ravel(), ys.ravel()])

    def contains(self, x: float, y: float) -> bool:
        """Return whether a point lies on the grid."""
        row, column = self.cell(x, y)
        return 0 <= row < self.shape[0] and 0 <= column < self.shape[1]

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, column) of the cell of a point; may lie beside the grid."""
        column = round((x - float(self.origin[0])) / self.resolution)
        row = round((y - float(self.origin[1])) / self.resolution)
        return row, column

    def distance_at(self, points: Vector) -> Vector:
        """Return the interpolated distance to the nearest obstacle [m], points (..., 2) -> (...).

        Zero beside the grid.
        """
        flat = np.asarray(points, dtype=float).reshape(-1, 2)
        coordinates = (flat[:, ::-1] - self.origin[::-1]) / self.resolution
        values = ndimage.map_coordinates(
            self.distance, coordinates.T, order=1, mode='constant', cval=0.0
        )
        return np.asarray(values).reshape(np.shape(points)[:-1])


def _to_segments(xs: Vector, ys: Vector, segments: Vector) -> Vector:
    """Return the distance of each cell to the nearest segment, (rows * columns,).

    One segment after the other over the whole grid: many times faster than all pairs at once,
    whose intermediate arrays do not fit into a cache.
    """
    nearest = np.full((len(ys), len(xs)), np.inf)
    for (x0, y0), (x1, y1) in segments:
        along_x, along_y = x1 - x0, y1 - y0
        length2 = max(along_x**2 + along_y**2, 1e-18)
        off_x, off_y = xs - x0, ys - y0
        share = off_x[None] * (along_x / length2) + off_y[:, None] * (along_y / length2)
        np.clip(share, 0.0, 1.0, out=share)
        away = (off_x[None] - share * along_x) ** 2 + (off_y[:, None] - share * along_y) ** 2
        np.minimum(nearest, away, out=nearest)
    return np.asarray(np.sqrt(nearest).ravel())


def _with_discs(distance: Vector, centres: Vector, discs: tuple[Disc, ...]) -> Vector:
    for disc in discs:
        away = np.hypot(centres[:, 0] - disc.x, centres[:, 1] - disc.y) - disc.radius
        distance = np.minimum(distance, np.maximum(away, 0.0))
    return distance


def _inside(points: Vector, corners: Vector) -> NDArray[np.bool_]:
    """Return which points lie inside a polygon, by counting crossings of a ray to the right."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points[:, 0], points[:, 1]
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        spans = (y0 > y) != (y1 > y)
        inside ^= spans & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside
