"""Line segments in the plane: distances, crossings and ray casting, vectorised.

A set of n segments is an array of shape (n, 2, 2): [segment, end, (x, y)].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def polygon_edges(corners: Array) -> Array:
    """Return the closed outline of a polygon, corners of shape (n, 2), as (n, 2, 2) segments."""
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def rectangle_corners(x: float, y: float, heading: float, length: float, width: float) -> Array:
    """Return the corners, counter-clockwise, shape (4, 2), of a turned rectangle.

    `length` lies along the heading, `width` across it.
    """
    cos, sin = np.cos(heading), np.sin(heading)
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    return np.asarray(half @ np.array([[cos, sin], [-sin, cos]]) + [x, y])


def distance_to_segments(points: Array, segments: Array) -> Array:
    """Return the distance of every point to every segment.

    Parameters
    ----------
    points : ndarray, shape (p, 2)
    segments : ndarray, shape (n, 2, 2)

    Returns
    -------
    ndarray, shape (p, n)
    """
    start = segments[None, :, 0]
    along = segments[None, :, 1] - start
    length2 = np.maximum(np.sum(along**2, axis=-1), 1e-18)
    offset = points[:, None, :] - start
    share = np.clip(np.sum(offset * along, axis=-1) / length2, 0.0, 1.0)
    nearest = start + share[..., None] * along
    return np.asarray(np.linalg.norm(points[:, None, :] - nearest, axis=-1))


def crosses(starts: Array, ends: Array, segments: Array) -> NDArray[np.bool_]:
    """Return which of the lines of sight cut which of the segments.

    Parameters
    ----------
    starts, ends : ndarray, shape (p, 2)
    segments : ndarray, shape (n, 2, 2)

    Returns
    -------
    ndarray of bool, shape (p, n)
        Touching at an end point counts as cutting; parallel lines do not cut.
    """
    sight = (ends - starts)[:, None, :]
    along = (segments[:, 1] - segments[:, 0])[None]
    offset = segments[None, :, 0] - starts[:, None, :]
    determinant = sight[..., 0] * along[..., 1] - sight[..., 1] * along[..., 0]
    parallel = np.abs(determinant) < 1e-12
    safe = np.where(parallel, 1.0, determinant)
    on_sight = (offset[..., 0] * along[..., 1] - offset[..., 1] * along[..., 0]) / safe
    on_segment = (offset[..., 0] * sight[..., 1] - offset[..., 1] * sight[..., 0]) / safe
    inside = (on_sight >= 0) & (on_sight <= 1) & (on_segment >= 0) & (on_segment <= 1)
    return np.asarray(inside & ~parallel)


def cast_rays(origins: Array, directions: Array, segments: Array) -> Array:
    """Return how far each ray flies before it meets a segment [m]; inf where it meets none.

    Parameters
    ----------
    origins : ndarray, shape (p, 2)
    directions : ndarray, shape (p, 2)
        Unit vectors.
    segments : ndarray, shape (n, 2, 2)

    Returns
    -------
    ndarray, shape (p,)
    """
    if len(segments) == 0:
        return np.full(len(origins), np.inf)
    ray = directions[:, None, :]
    along = (segments[:, 1] - segments[:, 0])[None]
    offset = segments[None, :, 0] - origins[:, None, :]
    determinant = ray[..., 0] * along[..., 1] - ray[..., 1] * along[..., 0]
    parallel = np.abs(determinant) < 1e-12
    safe = np.where(parallel, 1.0, determinant)
    distance = (offset[..., 0] * along[..., 1] - offset[..., 1] * along[..., 0]) / safe
    on_segment = (offset[..., 0] * ray[..., 1] - offset[..., 1] * ray[..., 0]) / safe
    hit = ~parallel & (distance >= 0) & (on_segment >= 0) & (on_segment <= 1)
    return np.asarray(np.min(np.where(hit, distance, np.inf), axis=1))
