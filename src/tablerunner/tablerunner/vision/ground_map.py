"""The place in map of every pixel at one height: made once, so that a picture costs little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.vision.ceiling_camera import CeilingCamera

Grid = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class GroundMap:
    """What pixels show at a height over the floor.

    Attributes
    ----------
    x, y : ndarray of float32, shape (height, width)
        Of the middle of each pixel in map [m]; NaN where no ray comes down.
    area : ndarray of float32, shape (height, width)
        What each pixel covers [m^2].
    """

    x: Grid
    y: Grid
    area: Grid


def ground_map(camera: CeilingCamera, height: float) -> GroundMap:
    """Return the map of a camera's pixels at a height [m]."""
    columns, rows = np.meshgrid(np.arange(camera.lens.width), np.arange(camera.lens.height))
    places = camera.places(np.stack([columns, rows], axis=-1), height)
    (x_down, x_right), (y_down, y_right) = (np.gradient(places[..., axis]) for axis in (0, 1))
    area = np.abs(x_right * y_down - x_down * y_right)
    return GroundMap(
        places[..., 0].astype(np.float32),
        places[..., 1].astype(np.float32),
        area.astype(np.float32),
    )
