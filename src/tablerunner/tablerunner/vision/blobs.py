"""Patches of one colour in a picture, measured in metres on the plane of their marker."""

from __future__ import annotations

import math
from dataclasses import dataclass

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

TOGETHER = 1.3
"""How much larger two discs that hang together are than the larger of them, with some room."""

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
    grain : float
        Width of a pixel there, as a share of the radius.
    surround : float
        Colour around it, as a share of its own.
    at_border : bool
        Whether it touches the border of the picture.
    """

    place: tuple[float, float]
    variance: float
    radius: float
    elongation: float
    grain: float
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
    """Return the discs of a mask that are neither far too small nor far too large.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
    mask : ndarray of uint8, shape (height, width)
    ground : GroundMap
        At the height of the marker.
    noise : float
        Deviation of a pixel in grey levels.
    radii : tuple of 2 floats
        Least and largest radius [m].
    """
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    found: list[Blob] = []
    for index in range(1, count):
        pixels = int(stats[index, cv2.CC_STAT_AREA])
        if pixels < LEAST_PIXELS:
            continue
        column, row = centres[index].astype(int)
        radius = math.sqrt(pixels * float(ground.area[row, column]) / math.pi)
        # Two discs of a coarse picture may hang together here.
        if not radii[0] < radius < TOGETHER * radii[1]:
            continue
        left, top, width, height = (int(value) for value in stats[index, :4])
        window = _Window(picture, ground, top, left, height, width)
        own = np.asarray(labels[window.part] == index, dtype=np.uint8)
        found += [blob for blob in window.discs(own, noise) if radii[0] < blob.radius < radii[1]]
    return found


class _Window:
    """The part of a picture around a patch of colour."""

    def __init__(
        self, picture: Picture, ground: GroundMap, top: int, left: int, height: int, width: int
    ) -> None:
        reach = EDGE_PIXELS + RING_PIXELS
        rows, columns = picture.shape[:2]
        self.part = np.s_[
            max(top - reach, 0) : top + height + reach, max(left - reach, 0) : left + width + reach
        ]
        self.at_border = left == 0 or top == 0 or left + width == columns or top + height == rows
        colours = picture[self.part]
        # Between a colour and any grey, max - min is in proportion to the share of the colour: of
        # a pixel at the rim, beside the whole ones next to it, it tells how much the disc covers.
        self._chroma = colours.max(axis=2) - colours.min(axis=2)
        self._whole = np.asarray(
            cv2.dilate(cv2.medianBlur(self._chroma, 3), _KERNEL, iterations=2), dtype=np.float32
        )
        self._ground = ground

    def discs(self, own: Mask, noise: float) -> list[Blob]:
        """Return what falls apart where less than half of a pixel has the colour."""
        behind = self._behind(own)
        half = np.asarray(own & (2.0 * (self._chroma - behind) > self._whole - behind))
        count, labels = cv2.connectedComponents(half.astype(np.uint8), connectivity=4)
        found = []
        for index in range(1, count):
            disc = np.asarray(labels == index, dtype=np.uint8)
            if int(disc.sum()) >= LEAST_PIXELS:
                others = np.asarray((labels > 0) & (disc == 0))
                blob = self._measure(disc, others, noise)
                if blob is not None:
                    found.append(blob)
        return found

    def _behind(self, own: Mask) -> float:
        """Return the colour of the plate around a patch."""
        near = cv2.dilate(own, _KERNEL, iterations=EDGE_PIXELS) > 0
        far = cv2.dilate(own, _KERNEL, iterations=EDGE_PIXELS + RING_PIXELS) > 0
        return float(np.median(self._chroma[far & ~near])) if np.any(far & ~near) else 0.0

    def _measure(self, own: Mask, others: NDArray[np.bool_], noise: float) -> Blob | None:
        disc = (cv2.dilate(own, _KERNEL, iterations=EDGE_PIXELS) > 0) & ~others
        behind = self._behind(own)
        full = self._whole[disc] - behind
        area = self._ground.area[self.part][disc]
        if full.min() <= 0.0 or not np.all(np.isfinite(area)):
            return None
        # The whole pixels count alike, so that the rim of a shadow on the disc does not draw its
        # centre.
        inner = cv2.erode(own, _KERNEL)[disc] > 0
        cover = np.clip((self._chroma[disc] - behind) / full, 0.0, 1.0)
        share = np.where(inner, 1.0, cover) * area
        total = float(share.sum())
        x = self._ground.x[self.part][disc].astype(float)
        y = self._ground.y[self.part][disc].astype(float)
        centre_x, centre_y = float(share @ x) / total, float(share @ y) / total
        x -= centre_x
        y -= centre_y
        xx, xy, yy = (float(share @ part) / total for part in (x * x, x * y, y * y))
        middle, half = (xx + yy) / 2.0, math.hypot((xx - yy) / 2.0, xy)
        # What noise of the pixels does to a weighted mean; max - min has that of two of them.
        spread = np.where(inner, 0.0, math.sqrt(2.0) * noise / full * area)
        variance = float(np.sum(spread**2 * (x * x + y * y))) / 2.0 / total**2
        radius = math.sqrt(total / math.pi)
        return Blob(
            (centre_x, centre_y),
            variance,
            radius,
            math.sqrt((middle + half) / max(middle - half, 1e-12)),
            math.sqrt(float(area.mean())) / radius,
            behind / float(np.median(self._whole[own > 0])),
            self.at_border,
        )
