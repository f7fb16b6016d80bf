"""The lens: rays to pixels and back, by the model 'plumb_bob' of sensor_msgs/CameraInfo.

With x, y a ray of the camera (z = 1) and r^2 = x^2 + y^2,

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
    u  = fx x' + cx,  v = fy y' + cy
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.types import Lens

Array = NDArray[np.float64]

ROUNDS = 12
"""Newton's method doubles the digits each round."""

SETTLED = 1e-10
"""Error of a ray [1] that is small enough: far below a thousandth of a pixel."""


def distort(lens: Lens, rays: ArrayLike) -> Array:
    """Return where rays meet the picture.

    Parameters
    ----------
    lens : Lens
    rays : array_like, shape (..., 2)
        x, y at z = 1 of the camera's optical frame (x right, y down, z ahead).

    Returns
    -------
    ndarray, shape (..., 2)
        u, v [pixel].
    """
    bent, _ = _bend(lens, np.asarray(rays, dtype=float))
    return np.asarray(bent * lens.focal + lens.centre)


def undistort(lens: Lens, pixels: ArrayLike) -> Array:
    """Return the rays of pixels, the inverse of `distort`, by Newton's method.

    Parameters
    ----------
    lens : Lens
    pixels : array_like, shape (..., 2)
        u, v [pixel].

    Returns
    -------
    ndarray, shape (..., 2)
        x, y at z = 1; NaN where no ray of the model comes to the pixel.
    """
    wanted = (np.asarray(pixels, dtype=float) - lens.centre) / lens.focal
    rays = wanted.copy()
    with np.errstate(all='ignore'):
        for _ in range(ROUNDS):
            bent, slope = _bend(lens, rays)
            missing = wanted - bent
            if not np.any(np.abs(missing) > SETTLED):
                break
            determinant = slope[0] * slope[3] - slope[1] * slope[2]
            rays = rays + np.stack(
                [
                    (slope[3] * missing[..., 0] - slope[1] * missing[..., 1]) / determinant,
                    (slope[0] * missing[..., 1] - slope[2] * missing[..., 0]) / determinant,
                ],
                axis=-1,
            )
        bent, slope = _bend(lens, rays)
        # Where the model folds back, a pixel has a second ray, on which no light has come.
        sound = (slope[0] * slope[3] - slope[1] * slope[2] > 0.0) & (slope[0] + slope[3] > 0.0)
        sound &= np.all(np.abs(wanted - bent) < 1e3 * SETTLED, axis=-1)
    return np.where(sound[..., None], rays, np.nan)


def _bend(lens: Lens, rays: Array) -> tuple[Array, tuple[Array, Array, Array, Array]]:
    """Return distorted rays and their derivatives dx'/dx, dx'/dy, dy'/dx, dy'/dy."""
    k1, k2, p1, p2, k3 = lens.distortion
    x, y = rays[..., 0], rays[..., 1]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    growth = 2.0 * (k1 + square * (2.0 * k2 + 3.0 * square * k3))  # d(radial)/d(r^2) times 2
    bent = np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )
    across = x * y * growth + 2.0 * p1 * x + 2.0 * p2 * y
    slope = (
        radial + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x,
        across,
        across,
        radial + y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x,
    )
    return bent, slope
