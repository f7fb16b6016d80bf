"""Where a pixel of a camera under the ceiling lies in the room, at a known height.

The formulas of the ceiling camera (PF-UIEKF, section 2.3; NOTES section 2): (3-4) height
correction, (5) camera to room. A camera that is not quite level is levelled first, so that both
hold as they are printed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError, GeometryError
from tablerunner.types import Lens
from tablerunner.vision.lens import distort, undistort

Array = NDArray[np.float64]

GRAZING = 0.05
"""Least part of a ray that points down: flatter ones meet the floor too far away to say where."""


@dataclass(frozen=True)
class CameraMount(Config):
    """Where the camera hangs and how it looks.

    With yaw and tilt zero it looks straight down, and the picture shows the room as a plan does:
    x of the map to the right, y upward.
    """

    position: tuple[float, ...] = parameter(
        (0.0, 0.0, 3.0),
        unit='m',
        description="The camera's pinhole in map: x, y, height over the floor",
        low=-1000.0,
        high=1000.0,
    )
    yaw: float = parameter(
        0.0,
        unit='rad',
        description="Direction in map of the picture's x axis",
        low=-math.pi,
        high=math.pi,
    )
    tilt: tuple[float, ...] = parameter(
        (0.0, 0.0),
        unit='rad',
        description="How far it is turned out of the vertical, about the picture's x and y axes",
        low=-1.0,
        high=1.0,
    )

    def check(self) -> None:
        """Refuse lists of another length, and a camera that does not hang."""
        if len(self.position) != 3:
            raise ConfigError('position', list(self.position), '3 numbers: x, y, height [m]')
        if len(self.tilt) != 2:
            raise ConfigError('tilt', list(self.tilt), '2 numbers [rad]')
        if self.position[2] <= 0.0:
            raise ConfigError('position[2]', self.position[2], 'a height above 0 [m]')

    @property
    def height(self) -> float:
        """Over the floor [m]."""
        return self.position[2]

    @property
    def levelling(self) -> Array:
        """Rotation from the camera's optical frame to one that is level, shape (3, 3).

        Its x axis is the picture's, its y axis up in the picture, its z axis up in the room.
        """
        (sin_x, sin_y), (cos_x, cos_y) = np.sin(self.tilt), np.cos(self.tilt)
        about_x = np.array([[1, 0, 0], [0, cos_x, -sin_x], [0, sin_x, cos_x]])
        about_y = np.array([[cos_y, 0, sin_y], [0, 1, 0], [-sin_y, 0, cos_y]])
        return np.asarray(np.diag([1.0, -1.0, -1.0]) @ about_x @ about_y)


def height_corrected(floor: ArrayLike, camera_height: float, height: float) -> Array:
    """Return where a point really is that seems to lie on the floor (3-4).

    Parameters
    ----------
    floor : array_like, shape (..., 2)
        Where its ray meets the floor, from the point under the camera [m].
    camera_height, height : float
        H and h: of the camera and of the point over the floor [m].

    Raises
    ------
    GeometryError
        The point is not below the camera.
    """
    if not height < camera_height:
        raise GeometryError(f'a height of {height} m is not below the camera ({camera_height} m)')
    return np.asarray(floor, dtype=float) * ((camera_height - height) / camera_height)


def to_room(points: ArrayLike, yaw: float, foot: ArrayLike) -> Array:
    """Return points of the camera's level frame in map (5).

    Parameters
    ----------
    points : array_like, shape (..., 2)
        From the point under the camera [m].
    yaw : float
        Of the camera in map [rad].
    foot : array_like, shape (2,)
        The point under the camera in map [m].
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    rotation = np.array([[cos, -sin], [sin, cos]])
    return np.asarray(np.asarray(points, dtype=float) @ rotation.T + np.asarray(foot, dtype=float))


@dataclass(frozen=True)
class CeilingCamera:
    """A lens where it hangs."""

    lens: Lens
    mount: CameraMount

    def floor_points(self, pixels: ArrayLike) -> Array:
        """Return where pixels' rays meet the floor, from the point under the camera [m].

        In the camera's level frame; NaN where a ray does not come down.
        """
        rays = undistort(self.lens, pixels)
        full = np.concatenate([rays, np.ones((*rays.shape[:-1], 1))], axis=-1)
        level = full @ self.mount.levelling.T
        down = -level[..., 2:] / np.linalg.norm(level, axis=-1, keepdims=True)
        with np.errstate(invalid='ignore', divide='ignore'):
            points = self.mount.height * level[..., :2] / -level[..., 2:]
            return np.where(down > GRAZING, points, np.nan)

    def places(self, pixels: ArrayLike, height: float) -> Array:
        """Return the places in map of what pixels show at a height over the floor.

        Parameters
        ----------
        pixels : array_like, shape (..., 2)
            u, v.
        height : float
            [m].

        Returns
        -------
        ndarray, shape (..., 2)
            [m]; NaN where no ray comes down.
        """
        corrected = height_corrected(self.floor_points(pixels), self.mount.height, height)
        return to_room(corrected, self.mount.yaw, self.mount.position[:2])

    def pixels(self, points: ArrayLike) -> Array:
        """Return where points of the room, shape (..., 3) [m], are in the picture.

        NaN where they are not before the camera.
        """
        cos, sin = math.cos(self.mount.yaw), math.sin(self.mount.yaw)
        about_z = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        offset = np.asarray(points, dtype=float) - np.asarray(self.mount.position)
        seen = offset @ about_z @ self.mount.levelling
        with np.errstate(invalid='ignore', divide='ignore'):
            rays = np.where(seen[..., 2:] > 0.0, seen[..., :2] / seen[..., 2:], np.nan)
        return distort(self.lens, rays)
