"""Where a camera hangs, from marked points whose places in the room are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from tablerunner.errors import GeometryError
from tablerunner.types import Lens
from tablerunner.vision.ceiling_camera import CameraMount, CeilingCamera
from tablerunner.vision.lens import undistort

Array = NDArray[np.float64]

LEAST_POINTS = 4
"""Three leave four cameras to choose from."""

WORST_RMS_PX = 5.0
"""A click is off by a pixel or two; what misses by more is another point, or another camera."""

WORST_STD_M = 0.1
"""Deviation of the camera's place above which the points say too little."""


@dataclass(frozen=True, eq=False)
class MountFit:
    """A camera's pose in the room.

    Attributes
    ----------
    mount : CameraMount
    residuals : ndarray, shape (n, 2)
        Clicked less expected [pixel].
    rms_px : float
    position_std : tuple of 3 floats
        Standard errors [m]; of as many points as numbers they cannot be told: NaN.
    angle_std : tuple of 3 floats
        The same of yaw and both tilts [rad].
    """

    mount: CameraMount
    residuals: Array
    rms_px: float
    position_std: tuple[float, float, float]
    angle_std: tuple[float, float, float]


def fit_mount(lens: Lens, pixels: ArrayLike, places: ArrayLike) -> MountFit:
    """Return the pose from which known points are seen where they were clicked.

    Parameters
    ----------
    lens : Lens
    pixels : array_like, shape (n, 2)
        u, v.
    places : array_like, shape (n, 3)
        In map [m].

    Raises
    ------
    GeometryError
        Too few points, all in a line, points that do not fit together (the worst is named), a
        camera that looks up.
    """
    clicked, known = np.asarray(pixels, dtype=float), np.asarray(places, dtype=float)
    if len(clicked) < LEAST_POINTS:
        raise GeometryError(f'{len(clicked)} points; {LEAST_POINTS} or more are needed')
    spread = np.linalg.svd(known - known.mean(axis=0), compute_uv=False)
    if spread[1] < 0.05 * max(spread[0], 1e-9):
        raise GeometryError('the points lie in one line')
    rays = undistort(lens, clicked)
    if not np.all(np.isfinite(rays)):
        index = int(np.flatnonzero(~np.isfinite(rays).all(axis=1))[0])
        raise GeometryError(f'no ray of this lens comes to the pixel of points[{index}]')
    start = _first(rays, known)

    def missing(values: Array) -> Array:
        mount = _mount(values)
        seen = CeilingCamera(lens, mount).pixels(known)
        return np.asarray(np.nan_to_num(clicked - seen, nan=1e4).ravel())

    try:
        found = least_squares(missing, start, x_scale=[1, 1, 1, 0.3, 0.3, 0.3])
        mount = _mount(found.x)
    except ValueError as error:
        raise GeometryError(f'no camera fits the points ({error})') from error
    residuals = np.asarray(found.fun).reshape(-1, 2)
    rms = float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
    if rms > WORST_RMS_PX:
        worst = int(np.argmax(np.linalg.norm(residuals, axis=1)))
        raise GeometryError(
            f'points miss the best fit by {rms:.1f} pixels (rms), points[{worst}] by '
            f'{np.linalg.norm(residuals[worst]):.1f}'
        )
    free = residuals.size - 6
    scale = float(np.sum(residuals**2)) / free if free > 0 else math.nan
    information = found.jac.T @ found.jac
    std = np.sqrt(np.diag(np.linalg.pinv(information)) * scale)
    if np.any(std[:3] > WORST_STD_M) or np.linalg.cond(information) > 1e12:
        raise GeometryError(
            'the points leave the place of the camera open: take more, farther apart'
        )
    deviations = [float(value) for value in std]
    return MountFit(
        mount,
        residuals,
        rms,
        (deviations[0], deviations[1], deviations[2]),
        (deviations[3], deviations[4], deviations[5]),
    )


def _first(rays: Array, known: Array) -> Array:
    """Return position, yaw, tilt to begin with, from the rays alone."""
    done, turn, shift = cv2.solvePnP(
        known.reshape(-1, 1, 3),
        rays.reshape(-1, 1, 2),
        np.eye(3),
        np.zeros(5),
        flags=cv2.SOLVEPNP_SQPNP,
    )
    if not done:
        raise GeometryError('no camera fits the points')
    matrix = np.asarray(cv2.Rodrigues(turn)[0], dtype=float).T  # from camera to map
    position = -matrix @ np.asarray(shift, dtype=float).ravel()
    # The rows of CameraMount.levelling, turned by yaw about z.
    tilt_x = math.asin(min(max(-matrix[2, 1], -1.0), 1.0))
    tilt_y = math.atan2(matrix[2, 0], -matrix[2, 2])
    if max(abs(tilt_x), abs(tilt_y)) > 1.0 or position[2] <= 0.0:
        raise GeometryError('the camera would not look down: pixels and places do not match')
    level = CameraMount(tilt=(tilt_x, tilt_y)).levelling
    about_z = matrix @ level.T
    yaw = math.atan2(about_z[1, 0], about_z[0, 0])
    return np.array([*position, yaw, tilt_x, tilt_y])


def _mount(values: Array) -> CameraMount:
    x, y, z, yaw, tilt_x, tilt_y = (float(value) for value in values)
    return CameraMount(
        (x, y, max(z, 1e-3)),
        math.remainder(yaw, 2.0 * math.pi),
        (min(max(tilt_x, -1.0), 1.0), min(max(tilt_y, -1.0), 1.0)),
    )
