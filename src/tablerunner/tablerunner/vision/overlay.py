"""What was seen, drawn into the picture: for people who look at the camera's work."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Refusal
from tablerunner.vision.ceiling_camera import CeilingCamera
from tablerunner.vision.locator import Observation
from tablerunner.vision.marker import MarkerConfig

Picture = NDArray[np.uint8]

FOUND, MISSED = (80, 255, 80), (80, 80, 255)
ARROW_M = 0.4

_CORNERS = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)


def draw_overlay(
    picture: Picture,
    camera: CeilingCamera,
    marker: MarkerConfig,
    found: Iterable[Observation | Refusal],
) -> Picture:
    """Return a copy of a picture with the discs that were found, headings, and what is missing.

    Parameters
    ----------
    picture : ndarray of uint8, shape (height, width, 3)
    camera : CeilingCamera
    marker : MarkerConfig
    found : iterable of Observation or Refusal
        What `CeilingLocator.add` said of it.
    """
    drawn = picture.copy()
    heights = dict(zip(marker.robots, marker.heights, strict=True))
    line = 0
    for item in found:
        if isinstance(item, Refusal):
            line += 1
            words = f'{item.key}: {item.reason}' if item.key else item.reason
            _write(drawn, words, (6, 14 * line), MISSED)
            continue
        height, sighting, pose = heights[item.robot], item.sighting, item.sample.pose
        for place, radius in zip(
            sighting.places, (marker.disc_radius, marker.front_radius), strict=False
        ):
            rim = radius * np.column_stack([np.cos(_CORNERS), np.sin(_CORNERS)]) + place
            pixels = _pixels(camera, rim, height)
            cv2.polylines(drawn, [pixels.reshape(-1, 1, 2)], True, FOUND, 1, cv2.LINE_AA)
        ends = np.array([(pose.x, pose.y), (pose.x, pose.y)])
        if math.isfinite(item.sample.covariance[2, 2]):
            ends[1] += ARROW_M * np.array([math.cos(pose.heading), math.sin(pose.heading)])
        start, end = _pixels(camera, ends, height).tolist()
        cv2.arrowedLine(drawn, start, end, FOUND, 1, cv2.LINE_AA)
        words = f'{item.robot} {sighting.confidence:.2f}'
        _write(drawn, words, (start[0] + 12, start[1] - 12), FOUND)
    return np.asarray(drawn, dtype=np.uint8)


def _pixels(
    camera: CeilingCamera, places: NDArray[np.float64], height: float
) -> NDArray[np.int32]:
    points = np.column_stack([places, np.full(len(places), height)])
    rounded = np.rint(np.nan_to_num(camera.pixels(points), nan=-100.0))
    return np.asarray(np.clip(rounded, -1e4, 1e4), dtype=np.int32)


def _write(
    picture: Picture, words: str, at: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    for thickness, ink in ((3, (0, 0, 0)), (1, colour)):
        cv2.putText(picture, words, at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, ink, thickness, cv2.LINE_AA)
