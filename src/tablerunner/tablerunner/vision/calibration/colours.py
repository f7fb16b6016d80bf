"""The colour of a marker, from points that were marked on it in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.errors import GeometryError
from tablerunner.geometry.angles import circular_mean, wrap

REACH_PX = 1
"""A marked point stands for the pixels around it, this many to each side."""

LEAST_SATURATION = 0.3
WORST_SPREAD_DEG = 20.0


@dataclass(frozen=True)
class ColourFit:
    """A marker's colour, and from where on a pixel is taken to have it.

    Attributes
    ----------
    hue : float
        [degrees]
    hue_tolerance : float
        Five times its deviation between the pixels, within 12 to 25 [degrees].
    least_saturation : float
        Three fifths of the palest pixel.
    least_value : float
        A quarter of the darkest pixel: the light may become as much less.
    pixels : int
        How many it is from.
    """

    hue: float
    hue_tolerance: float
    least_saturation: float
    least_value: float
    pixels: int


def fit_colour(picture: NDArray[np.uint8], points: ArrayLike) -> ColourFit:
    """Return the colour around points of a picture.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    points : array_like, shape (n, 2)
        u, v on the marker's discs [pixel].

    Raises
    ------
    GeometryError
        No points, one outside the picture, no colour there, or several.
    """
    middles = np.rint(np.asarray(points, dtype=float)).astype(int).reshape(-1, 2)
    if not len(middles):
        raise GeometryError('no points on the marker')
    height, width = picture.shape[:2]
    inside = np.all((middles >= 0) & (middles < (width, height)), axis=1)
    if not inside.all():
        index = int(np.flatnonzero(~inside)[0])
        raise GeometryError(f'pixels[{index}] lies outside the picture of {width} x {height}')
    hsv = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV))
    reach = range(-REACH_PX, REACH_PX + 1)
    rows, columns = (
        np.clip([middle[axis] + step for middle in middles for step in reach], 0, size - 1)
        for axis, size in ((1, height), (0, width))
    )
    side = len(reach)
    patches = [
        hsv[np.ix_(rows[first : first + side], columns[first : first + side])].reshape(-1, 3)
        for first in range(0, len(rows), side)
    ]
    sample = np.concatenate(patches).astype(float)
    angles = np.radians(2.0 * sample[:, 0])
    saturation, value = sample[:, 1] / 255.0, sample[:, 2] / 255.0
    if float(np.median(saturation)) < LEAST_SATURATION:
        raise GeometryError(
            f'hardly any colour there (saturation {np.median(saturation):.2f}, '
            f'{LEAST_SATURATION} or more is needed): points beside the discs, or a grey marker'
        )
    hue = circular_mean(angles)
    off = np.degrees(np.abs(wrap(angles - hue)))
    if float(np.percentile(off, 80.0)) > WORST_SPREAD_DEG:
        raise GeometryError('points of several colours')
    spread = float(np.sqrt(np.mean(off**2)))
    return ColourFit(
        round(float(np.degrees(hue)) % 360.0, 1),
        round(min(max(5.0 * spread, 12.0), 25.0), 1),
        round(0.6 * float(np.percentile(saturation, 5.0)), 3),
        round(max(0.25 * float(np.percentile(value, 5.0)), 0.05), 3),
        len(sample),
    )
