"""Slant ranges and the plane in which the tag moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.errors import GeometryError

Array = NDArray[np.float64]


def slant_to_plane(slant: ArrayLike, height: ArrayLike) -> Array:
    """Return the distance in the plane that a slant range and a height leave (after Sun 38).

    Parameters
    ----------
    slant : array_like
        Distance between antennas [m].
    height : array_like, broadcast
        Height of the anchor over the tag, or below it [m].

    Returns
    -------
    ndarray
        sqrt(slant^2 - height^2) [m]; NaN where the range is shorter than the height.
    """
    length, rise = np.asarray(slant, dtype=float), np.asarray(height, dtype=float)
    with np.errstate(invalid='ignore'):
        # As a product: no digits lost where both are nearly equal.
        return np.asarray(
            np.sqrt((length - np.abs(rise)) * (length + np.abs(rise)))
            * np.where(length >= 0.0, 1.0, np.nan)
        )


def plane_to_slant(plane: ArrayLike, height: ArrayLike) -> Array:
    """Return the slant range of a distance in the plane and a height [m]."""
    return np.asarray(np.hypot(np.asarray(plane, dtype=float), np.asarray(height, dtype=float)))


def plane_deviation(slant: ArrayLike, height: ArrayLike, std: ArrayLike) -> Array:
    """Return the standard deviation of the plane distance [m].

    d(plane)/d(slant) = slant / plane: near below an anchor the plane distance is hardly measured;
    inf right below it.
    """
    plane = slant_to_plane(slant, height)
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.asarray(np.asarray(slant) / plane * np.asarray(std))


def tag_in_map(base: ArrayLike, heading: ArrayLike, lever_arm: ArrayLike) -> Array:
    """Return where the tag is.

    Parameters
    ----------
    base : array_like, shape (..., 2)
        base_link in map [m].
    heading : array_like, shape (...)
        [rad].
    lever_arm : array_like, shape (3,)
        Tag in base_link [m].

    Returns
    -------
    ndarray, shape (..., 3)
        Tag in map [m].
    """
    place, arm = np.asarray(base, dtype=float), _lever(lever_arm)
    x, y = _turned(heading, arm)
    return np.stack(
        [place[..., 0] + x, place[..., 1] + y, np.broadcast_to(arm[2], np.shape(x))], axis=-1
    )


def base_in_map(
    tag: ArrayLike,
    covariance: ArrayLike,
    heading: ArrayLike,
    heading_variance: ArrayLike,
    lever_arm: ArrayLike,
) -> tuple[Array, Array]:
    """Return where base_link is when the tag's place and the heading are known.

    Parameters
    ----------
    tag : array_like, shape (..., 2)
        Tag in map [m].
    covariance : array_like, shape (..., 2, 2)
        Of the tag's place [m^2].
    heading, heading_variance : array_like, shape (...)
        [rad], [rad^2]; taken to be independent of the tag's place.
    lever_arm : array_like, shape (3,)
        Tag in base_link [m].

    Returns
    -------
    place : ndarray, shape (..., 2)
        [m].
    covariance : ndarray, shape (..., 2, 2)
        [m^2]; an uncertain heading turns the lever arm.
    """
    place = np.asarray(tag, dtype=float)
    x, y = _turned(heading, _lever(lever_arm))
    base = np.stack([place[..., 0] - x, place[..., 1] - y], axis=-1)
    # How the base moves when the heading does and the tag stays.
    swing = np.stack([y, -x], axis=-1)
    variance = np.asarray(heading_variance, dtype=float)[..., None, None]
    return base, np.asarray(covariance, dtype=float) + variance * (
        swing[..., :, None] * swing[..., None, :]
    )


def _lever(lever_arm: ArrayLike) -> Array:
    arm = np.asarray(lever_arm, dtype=float)
    if arm.shape != (3,) or not np.all(np.isfinite(arm)):
        raise GeometryError(f'the lever arm is {lever_arm!r}, three finite numbers are needed')
    return arm


def _turned(heading: ArrayLike, arm: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray(cos * arm[0] - sin * arm[1]), np.asarray(sin * arm[0] + cos * arm[1])
