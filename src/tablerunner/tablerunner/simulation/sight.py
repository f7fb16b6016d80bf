"""Whether something stands in the straight line between two antennas, heights included."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.scenario import Outline
from tablerunner.simulation.truth import PersonState

Array = NDArray[np.float64]

_NEAR_END_M = 0.05  # what an antenna is mounted on does not block it
_SKIN_M = 0.1


class Sight:
    """Everything that stands still, ready to be asked many times.

    Parameters
    ----------
    outlines : sequence of Outline
    """

    def __init__(self, outlines: Sequence[Outline]) -> None:
        segments = [outline.segments for outline in outlines]
        self._segments = np.concatenate(segments) if segments else np.empty((0, 2, 2))
        self._heights = np.array(
            [outline.height_m for outline in outlines for _ in outline.segments]
        )
        self._along = self._segments[:, 1] - self._segments[:, 0]

    def thing_blocks(
        self, tag: tuple[float, float, float], anchor: tuple[float, float, float]
    ) -> bool:
        """Return whether the line from tag to anchor passes through a wall, table or box.

        It does where it crosses an edge of the thing's outline lower than the thing is high.
        """
        dx, dy, dz = anchor[0] - tag[0], anchor[1] - tag[1], anchor[2] - tag[2]
        flat_m = float(np.hypot(dx, dy))
        if len(self._segments) == 0 or flat_m < 2 * _NEAR_END_M:
            return False
        determinant = dx * self._along[:, 1] - dy * self._along[:, 0]
        parallel = np.abs(determinant) < 1e-12
        safe = np.where(parallel, 1.0, determinant)
        off_x = self._segments[:, 0, 0] - tag[0]
        off_y = self._segments[:, 0, 1] - tag[1]
        on_sight = (off_x * self._along[:, 1] - off_y * self._along[:, 0]) / safe
        on_edge = (off_x * dy - off_y * dx) / safe
        end = _NEAR_END_M / flat_m
        hit = ~parallel & (on_edge >= 0) & (on_edge <= 1) & (on_sight > end) & (on_sight < 1 - end)
        return bool(np.any(hit & (tag[2] + on_sight * dz < self._heights)))

    def thing_blocks_many(
        self, tag: Array, height: float, anchor: tuple[float, float, float]
    ) -> NDArray[np.bool_]:
        """Return `thing_blocks` of many tags of one height at once, shape (runs,).

        Parameters
        ----------
        tag : ndarray, shape (2, runs)
            In map [m].
        height : float
            Of the tags [m].
        anchor : tuple
            In map [m].
        """
        dx, dy, dz = anchor[0] - tag[0], anchor[1] - tag[1], anchor[2] - height
        flat_m = np.maximum(np.hypot(dx, dy), 1e-12)
        along_x, along_y = self._along[:, :1], self._along[:, 1:]  # (segments, 1)
        determinant = dx * along_y - dy * along_x
        parallel = np.abs(determinant) < 1e-12
        safe = np.where(parallel, 1.0, determinant)
        off_x = self._segments[:, 0, :1] - tag[0]
        off_y = self._segments[:, 0, 1:] - tag[1]
        on_sight = (off_x * along_y - off_y * along_x) / safe
        on_edge = (off_x * dy - off_y * dx) / safe
        end = _NEAR_END_M / flat_m
        hit = ~parallel & (on_edge >= 0) & (on_edge <= 1) & (on_sight > end) & (on_sight < 1 - end)
        hit &= height + on_sight * dz < self._heights[:, None]
        return np.asarray(hit.any(axis=0) & (flat_m >= 2 * _NEAR_END_M))


def person_blocks(
    tag: tuple[float, float, float],
    anchor: tuple[float, float, float],
    people: Sequence[PersonState],
    heights: Sequence[float],
) -> bool:
    """Return whether the line from tag to anchor passes through a person, an upright cylinder."""
    return any(
        _way_inside(tag, anchor, person, height) > 0.0
        for person, height in zip(people, heights, strict=True)
    )


def wearer_blocks(
    tag: tuple[float, float, float],
    anchor: tuple[float, float, float],
    wearer: PersonState,
    height: float,
) -> bool:
    """Return whether the body that wears a tag stands between it and an anchor.

    The tag is on the skin of an upright cylinder, or in a hand: a line that cuts off less than
    0.1 m of the body counts as free.
    """
    return _way_inside(tag, anchor, wearer, height) > _SKIN_M


def _way_inside(
    tag: tuple[float, float, float],
    anchor: tuple[float, float, float],
    person: PersonState,
    height: float,
) -> float:
    """Return how far over the floor the line from tag to anchor runs inside a body [m]."""
    dx, dy, dz = anchor[0] - tag[0], anchor[1] - tag[1], anchor[2] - tag[2]
    flat2 = dx * dx + dy * dy
    if flat2 < 1e-12:
        return 0.0
    px, py = person.pose.x - tag[0], person.pose.y - tag[1]
    middle = (px * dx + py * dy) / flat2
    miss2 = (px - middle * dx) ** 2 + (py - middle * dy) ** 2
    half2 = (person.radius_m**2 - miss2) / flat2
    if half2 <= 0.0:
        return 0.0
    half = math.sqrt(half2)
    enter, leave = max(middle - half, 0.0), min(middle + half, 1.0)
    if enter >= leave or min(tag[2] + enter * dz, tag[2] + leave * dz) >= height:
        return 0.0
    return (leave - enter) * math.sqrt(flat2)
