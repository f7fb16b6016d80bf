"""Circles in the plane, vectorised: rays against round things (people, columns)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cast_rays_at_circles(origins: Array, directions: Array, centres: Array, radii: Array) -> Array:
    """Return how far each ray flies before it meets a circle [m]; inf where it meets none.

    Parameters
    ----------
    origins, directions : ndarray, shape (p, 2)
        Directions are unit vectors. A ray that starts inside a circle meets it at 0.
    centres : ndarray, shape (n, 2)
    radii : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (p,)
    """
    if len(centres) == 0:
        return np.full(len(origins), np.inf)
    offset = centres[None] - origins[:, None, :]
    along = np.sum(offset * directions[:, None, :], axis=-1)
    miss2 = np.sum(offset**2, axis=-1) - along**2
    half_chord2 = radii[None] ** 2 - miss2
    near = along - np.sqrt(np.maximum(half_chord2, 0.0))
    far = along + np.sqrt(np.maximum(half_chord2, 0.0))
    hit = (half_chord2 >= 0) & (far >= 0)
    return np.asarray(np.min(np.where(hit, np.maximum(near, 0.0), np.inf), axis=1))


def sight_crosses_circles(
    starts: Array, ends: Array, centres: Array, radii: Array
) -> NDArray[np.bool_]:
    """Return which lines of sight, (p, 2) to (p, 2), pass through which circles, shape (p, n)."""
    sight = ends - starts
    length2 = np.maximum(np.sum(sight**2, axis=-1), 1e-18)[:, None]
    offset = centres[None] - starts[:, None, :]
    share = np.clip(np.sum(offset * sight[:, None, :], axis=-1) / length2, 0.0, 1.0)
    nearest = starts[:, None, :] + share[..., None] * sight[:, None, :]
    return np.asarray(np.linalg.norm(centres[None] - nearest, axis=-1) <= radii[None])
