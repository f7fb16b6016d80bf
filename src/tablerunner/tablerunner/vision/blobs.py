"""Patches of one colour in a picture, measured in metres on the plane of their marker."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.vision.ground_map import GroundMap
from tablerunner.vision.marker import MarkerConfig

Picture = NDArray[np.uint8]
Mask = NDArray[np.uint8]

HALF_TURN = 180
"""Hues of OpenCV's 8-bit pictures: two degrees each."""

LEAST_PIXELS = 6
"""A patch of fewer is noise."""

EDGE_PIXELS = 2
"""How far the soft edge of a disc reaches."""

RING_PIXELS = 5
"""How far beyond the disc its plate is looked at."""

_KERNEL = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class Blob:
    """A patch of colour.

    Attributes
    ----------
    place : tuple
        Its centre in map, if it is at the height of the marker [m].
    variance : float
        Of either coordinate of it, from the noise of the pixels [m^2].
    radius : float
        Of a disc of the same area [m].
    elongation : float
        How much longer than wide it is: 1 for a disc.
    surround : float
        Colour around it, as a share of its own.
    at_border : bool
        Whether it touches the border of the picture.
    """

    place: tuple[float, float]
    variance: float
    radius: float
    elongation: float
    surround: float
    at_border: bool


def colour_masks(picture: Picture, config: MarkerConfig) -> list[Mask]:
    """Return where each robot's colour is: for each of `config.robots` 255 or 0 by pixel."""
    hsv = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV), dtype=np.uint8)
    least = (round(255 * config.least_saturation), round(255 * config.least_value))
    tolerance = config.hue_tolerance / 2.0
    masks = []
    for hue in config.hues:
        low, high = math.ceil(hue / 2.0 - tolerance), math.floor(hue / 2.0 + tolerance)
        mask = _between(hsv, max(low, 0), min(high, HALF_TURN - 1), least)
        if low < 0:
            mask |= _between(hsv, low + HALF_TURN, HALF_TURN - 1, least)
        if high >= HALF_TURN:
            mask |= _between(hsv, 0, high - HALF_TURN, least)
        masks.append(mask)
    return masks


def _between(hsv: Picture, low: int, high: int, least: tuple[int, int]) -> Mask:
    mask = cv2.inRange(hsv, np.array([low, *least]), np.array([high, 255, 255]))
    return np.asarray(mask, dtype=np.uint8)


def blobs_of(
    picture: Picture, mask: Mask, ground: GroundMap, noise: float, radii: tuple[float, float]
) -> list[Blob]:
    """Return the patches of a mask that are neither far too small nor far too large.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
    mask : ndarray of uint8, shape (height, width)
    ground : GroundMap
        At the height of the marker.
    noise : float
        Deviation of a pixel in grey levels.
    radii : tuple of 2 floats
        Least and largest radius worth a closer look [m].
    """
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    patches = np.asarray(labels, dtype=np.int32)
    found = []
    for index in range(1, count):
        pixels = int(stats[index, cv2.CC_STAT_AREA])
        if pixels < LEAST_PIXELS:
            continue
        column, row = centres[index].astype(int)
        radius = math.sqrt(pixels * float(ground.area[row, column]) / math.pi)
        if not radii[0] < radius < radii[1]:
            continue
        blob = _measure(picture, patches, index, stats[index], ground, noise)
        if blob is not None:
            found.append(blob)
    return found


def _measure(
    picture: Picture,
    labels: NDArray[np.int32],
    index: int,
    stats: NDArray[Any],
    ground: GroundMap,
    noise: float,
) -> Blob | None:
    left, top, width, height = (int(value) for value in stats[:4])
    rows, columns = labels.shape
    border = left == 0 or top == 0 or left + width == columns or top + height == rows
    reach = EDGE_PIXELS + RING_PIXELS
    window = np.s_[
        max(top - reach, 0) : top + height + reach, max(left - reach, 0) : left + width + reach
    ]
    own = np.asarray(labels[window] == index, dtype=np.uint8)
    disc = cv2.dilate(own, _KERNEL, iterations=EDGE_PIXELS) > 0
    ring = (cv2.dilate(own, _KERNEL, iterations=reach) > 0) & ~disc
    colours = picture[window]
    # Between a colour and any grey, max - min is in proportion to the share of the colour: the
    # weight of a pixel that a disc covers in part.
    chroma = colours.max(axis=2).astype(np.float32) - colours.min(axis=2)
    behind = float(np.median(chroma[ring])) if ring.any() else 0.0
    full = float(np.percentile(chroma[own > 0], 75.0)) - behind
    area = ground.area[window][disc]
    if full <= 0.0 or not np.all(np.isfinite(area)):
        return None
    share = np.clip((chroma[disc] - behind) / full, 0.0, None) * area
    total = float(share.sum())
    x, y = ground.x[window][disc].astype(float), ground.y[window][disc].astype(float)
    centre_x, centre_y = float(share @ x) / total, float(share @ y) / total
    x -= centre_x
    y -= centre_y
    xx, xy, yy = (float(share @ part) / total for part in (x * x, x * y, y * y))
    middle, half = (xx + yy) / 2.0, math.hypot((xx - yy) / 2.0, xy)
    # What noise of the pixels does to a weighted mean; max - min has that of two of them.
    spread = math.sqrt(2.0) * noise / full * area
    variance = float(np.sum(spread**2 * (x * x + y * y))) / 2.0 / total**2
    return Blob(
        (centre_x, centre_y),
        variance,
        math.sqrt(total / math.pi),
        math.sqrt((middle + half) / max(middle - half, 1e-12)),
        behind / (full + behind),
        border,
    )
