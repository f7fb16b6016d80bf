"""Pictures of a chequerboard, for trying a calibration."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.simulation.camera.rays import Rays

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

DARK, LIGHT, AROUND = 30.0, 225.0, 120.0

_FINE = 3


def board_picture(
    rays: Rays,
    squares: tuple[int, int],
    square_m: float,
    centre: tuple[float, float, float],
    turn: Array,
    random: np.random.Generator,
) -> Picture:
    """Return what a camera sees of a chequerboard, shape (height, width, 3).

    Parameters
    ----------
    rays : Rays
    squares : tuple of 2 ints
        Along and across; there is one inner corner less each way.
    square_m : float
    centre : tuple
        Of the board in map [m].
    turn : ndarray, shape (3, 3)
        Its axes in map, as columns.
    random : Generator
        Of the noise.
    """
    across, down = (np.gradient(rays.slopes, axis=axis) for axis in (1, 0))
    from_camera = np.array(centre) - rays.camera.position
    size = np.array(squares) * square_m
    total = np.zeros(rays.slopes.shape[:2])
    steps = (np.arange(_FINE) + 0.5) / _FINE - 0.5
    for below in steps:
        for right in steps:
            slopes = rays.slopes + right * across + below * down
            ways = np.concatenate([slopes, -np.ones((*slopes.shape[:2], 1))], axis=-1)
            share = (from_camera @ turn[:, 2]) / (ways @ turn[:, 2])
            on_board = (share[..., None] * ways - from_camera) @ turn[:, :2] + size / 2.0
            cell = np.floor(on_board / square_m).astype(int)
            colour = np.where(cell.sum(axis=-1) % 2 == 0, DARK, LIGHT)
            # A white margin of one square.
            colour[np.any((on_board < 0.0) | (on_board > size), axis=-1)] = LIGHT
            off = np.any((on_board < -square_m) | (on_board > size + square_m), axis=-1)
            colour[off | (share <= 0.0)] = AROUND
            total += colour
    sharp = total / _FINE**2
    blur = rays.camera.blur
    soft = cv2.GaussianBlur(sharp, (0, 0), blur) if blur > 0.0 else sharp
    noisy = soft + random.normal(0.0, rays.camera.noise, total.shape)
    grey = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)
