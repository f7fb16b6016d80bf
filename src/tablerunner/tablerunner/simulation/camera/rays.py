"""Where each pixel of a camera looks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.scenario import Camera

Array = NDArray[np.float64]

_ROUNDS = 200
_CLOSE_PX = 1e-6
_FLATTEST = 20.0  # [m/m]: rays flatter than this are taken to be this flat


@dataclass(frozen=True, eq=False)
class Rays:
    """A camera as a set of rays.

    Attributes
    ----------
    camera : Camera
        As it really hangs.
    """

    camera: Camera

    @cached_property
    def matrix(self) -> Array:
        """Camera matrix, shape (3, 3)."""
        (fx, fy), (cx, cy) = self.camera.focal, self.camera.middle
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @cached_property
    def axes(self) -> Array:
        """The picture's right, its down and the view as vectors of the room, columns (3, 3)."""
        right = np.array([np.cos(self.camera.yaw), np.sin(self.camera.yaw), 0.0])
        view = np.array([0.0, 0.0, -1.0])
        level = np.column_stack([right, np.cross(view, right), view])
        about_x, about_y = self.camera.tilt
        turn_x, _ = cv2.Rodrigues(np.array([about_x, 0.0, 0.0]))
        turn_y, _ = cv2.Rodrigues(np.array([0.0, about_y, 0.0]))
        return np.asarray(level @ turn_x @ turn_y)

    def project(self, points: Array) -> Array:
        """Return the pixels, shape (n, 2), of points of the room, shape (n, 3) [m]."""
        seen = (points - np.array(self.camera.position)) @ self.axes
        found, _ = cv2.projectPoints(
            seen.reshape(-1, 1, 3),
            np.zeros(3),
            np.zeros(3),
            self.matrix,
            np.array(self.camera.distortion),
        )
        return np.asarray(found, dtype=float).reshape(-1, 2)

    @cached_property
    def slopes(self) -> NDArray[np.float32]:
        """How far each pixel's ray goes along x and y of map for each metre down, (h, w, 2)."""
        columns, rows = np.meshgrid(np.arange(self.camera.width), np.arange(self.camera.height))
        wanted = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
        straight = (wanted - self.camera.middle) / self.camera.focal
        rays, k = straight.copy(), self.camera.distortion
        for _ in range(_ROUNDS):
            # Divide by what the lens does at the last guess: a slow way to the same ray, and
            # another one than that of tablerunner.vision.
            square = np.sum(rays**2, axis=1)
            radial = 1.0 + k[0] * square + k[1] * square**2 + k[4] * square**3
            both = rays[:, 0] * rays[:, 1]
            aside = np.column_stack(
                [
                    2.0 * k[2] * both + k[3] * (square + 2.0 * rays[:, 0] ** 2),
                    2.0 * k[3] * both + k[2] * (square + 2.0 * rays[:, 1] ** 2),
                ]
            )
            last, rays = rays, (straight - aside) / radial[:, None]
            if np.max(np.abs(rays - last)) * max(self.camera.focal) < _CLOSE_PX:
                break
        ways = np.column_stack([rays, np.ones(len(rays))]) @ self.axes.T
        down = np.maximum(-ways[:, 2:], np.linalg.norm(ways[:, :2], axis=1)[:, None] / _FLATTEST)
        slopes = ways[:, :2] / np.maximum(down, 1e-9)
        grid = slopes.reshape(self.camera.height, self.camera.width, 2)
        return np.asarray(grid, dtype=np.float32)
