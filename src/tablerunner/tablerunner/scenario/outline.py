"""Footprint and height of a thing that stands in the room."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Outline:
    """A polyline or polygon on the floor and how high the thing over it is.

    Attributes
    ----------
    name : str
    kind : str
        ``wall``, ``table`` or ``box``.
    corners : ndarray, shape (n, 2)
        In map [m]; a polygon's counter-clockwise.
    closed : bool
        Whether it is a polygon (a closed wall is one too, but has no inside).
    height_m : float
    """

    name: str
    kind: str
    corners: Array
    closed: bool
    height_m: float

    @property
    def is_solid(self) -> bool:
        """Whether nothing can stand inside."""
        return self.kind != 'wall'

    @cached_property
    def segments(self) -> Array:
        """Its edges, shape (m, 2, 2)."""
        edges = np.stack([self.corners, np.roll(self.corners, -1, axis=0)], axis=1)
        return edges if self.closed else edges[:-1]

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Return which of the points, shape (p, 2), stand inside a convex solid."""
        if not self.is_solid:
            return np.zeros(len(points), dtype=bool)
        edges = self.segments
        along = (edges[:, 1] - edges[:, 0])[None]
        offset = points[:, None, :] - edges[None, :, 0]
        turned = along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0]
        return np.asarray(np.all(turned >= 0.0, axis=1))
