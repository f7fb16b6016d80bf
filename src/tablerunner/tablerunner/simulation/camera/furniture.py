"""What stands still in the camera's picture: floor, walls, tables, boxes; drawn once."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.scenario import Outline, Scenario
from tablerunner.simulation.camera.rays import Rays

Grid = NDArray[np.float32]
Picture = NDArray[np.uint8]

_OFFSETS = ((-0.25, 0.25), (0.25, -0.25))

# Blue, green, red.
TILES = ((168.0, 180.0, 186.0), (150.0, 160.0, 168.0))
TILE_M, JOINT_M = 0.6, 0.012
JOINT = (112.0, 118.0, 122.0)
FACES = {
    'wall': (205.0, 214.0, 218.0),
    'table': (92.0, 130.0, 172.0),
    'box': (150.0, 150.0, 146.0),
}
TABLE_CLOTH = (226.0, 230.0, 232.0)
_SIDE = 0.62  # of the light, on upright faces


@dataclass(frozen=True, eq=False)
class Furniture:
    """The picture of the empty room.

    Attributes
    ----------
    picture : ndarray of float32, shape (height, width, 3)
        Blue, green, red before light, blur and noise.
    tops : ndarray of float32, shape (height, width)
        Height over the floor of what each pixel shows [m].
    """

    picture: Grid
    tops: Grid


def draw_furniture(scenario: Scenario, rays: Rays, random: np.random.Generator) -> Furniture:
    """Return the picture of a scenario's room without people and robots."""
    camera = rays.camera
    across, down = (np.gradient(rays.slopes, axis=axis) for axis in (1, 0))
    clutter = _Clutter(scenario, camera.clutter, random)
    stains = random.standard_normal((64, 64)).astype(np.float32)
    total = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
    for right, below in _OFFSETS:
        slopes = rays.slopes + right * across + below * down
        total += _sample(scenario, rays, slopes, clutter, stains)[0]
    _, tops = _sample(scenario, rays, rays.slopes, clutter, stains)
    return Furniture(total / np.float32(len(_OFFSETS)), tops)


def _sample(
    scenario: Scenario, rays: Rays, slopes: Grid, clutter: _Clutter, stains: Grid
) -> tuple[Grid, Grid]:
    x, y, high = rays.camera.position
    foot = np.array([x, y], dtype=np.float32)
    floor = foot + slopes * np.float32(high)
    picture = _floor(floor, stains)
    clutter.paint(picture, floor)
    tops = np.zeros(slopes.shape[:2], dtype=np.float32)
    # Plane by plane: minima over the last axis of two numbers are slow.
    slope_x, slope_y = (np.ascontiguousarray(slopes[..., axis]) for axis in (0, 1))
    plan = _Plan(slope_x, slope_y, foot, high)
    for outline in scenario.outlines:
        _stand(outline, picture, tops, plan)
    return picture, tops


def _floor(places: Grid, stains: Grid) -> Grid:
    tile = np.floor(places / TILE_M).astype(np.int64)
    within = places - tile * TILE_M
    odd = (tile.sum(axis=-1) & 1).astype(bool)
    picture = np.array(TILES, dtype=np.float32)[odd.astype(int)]
    joint = np.any(within < JOINT_M, axis=-1)
    picture[joint] = JOINT
    # Each tile has a shade of its own, and stains run over all of them.
    size = len(stains)
    picture += 4.0 * stains[tile[..., 0] % size, tile[..., 1] % size][..., None]
    spot = np.mod(places * 0.8, size).astype(np.float32)
    smooth = cv2.remap(
        stains, spot[..., 0], spot[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
    )
    picture += 5.0 * np.asarray(smooth, dtype=np.float32)[..., None]
    return np.asarray(picture, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class _Plan:
    """Where rays go: slopes along x and y, from above a point, at a height [m]."""

    slope_x: Grid
    slope_y: Grid
    foot: Grid
    high: float

    def at(self, height: float) -> tuple[Grid, Grid]:
        """Return x and y where the rays pass a height [m]."""
        drop = np.float32(self.high - height)
        return self.foot[0] + self.slope_x * drop, self.foot[1] + self.slope_y * drop


def _stand(outline: Outline, picture: Grid, tops: Grid, plan: _Plan) -> None:
    """Draw a thing where it hides what was drawn before it.

    A ray that comes down from the thing's height runs over the floor along a line: it meets the
    top where that line begins inside, else a side where the line first crosses an edge.
    """
    height = min(outline.height_m, 0.98 * plan.high)
    low, most = outline.corners.min(axis=0), outline.corners.max(axis=0)
    near = np.ones(tops.shape, dtype=bool)
    ends = []
    for axis, (upper, lower) in enumerate(zip(plan.at(height), plan.at(0.0), strict=True)):
        near &= (np.minimum(upper, lower) <= most[axis]) & (np.maximum(upper, lower) >= low[axis])
        ends.append((upper, lower))
    if not near.any():
        return
    start = np.column_stack([upper[near] for upper, _ in ends]).astype(float)
    way = np.column_stack([lower[near] for _, lower in ends]).astype(float) - start
    reached = np.full(len(start), -1.0)
    shade = np.full(len(start), _SIDE)
    for here, there in outline.segments:
        along = there - here
        cross = way[:, 0] * along[1] - way[:, 1] * along[0]
        safe = np.where(np.abs(cross) < 1e-12, 1e-12, cross)
        offset = here - start
        on_way = (offset[:, 0] * along[1] - offset[:, 1] * along[0]) / safe
        on_edge = (offset[:, 0] * way[:, 1] - offset[:, 1] * way[:, 0]) / safe
        hit = (on_way >= 0.0) & (on_way <= 1.0) & (on_edge >= 0.0) & (on_edge <= 1.0)
        at = np.where(hit, height * (1.0 - on_way), -1.0)
        nearer = at > reached
        reached[nearer] = at[nearer]
        # Sides that look another way get other light.
        shade[nearer] = _SIDE + 0.12 * along[0] / max(float(np.hypot(*along)), 1e-9)
    inside = outline.contains(start)
    reached[inside], shade[inside] = height, 1.0
    visible = reached > tops[near]
    rows, columns = (index[visible] for index in np.nonzero(near))
    face = np.array(FACES[outline.kind])
    colours = shade[visible, None] * face
    if outline.kind == 'table':
        # A cloth in the middle of the top.
        centre = outline.corners.mean(axis=0)
        cloth = inside[visible] & outline.contains(
            (start[visible] - centre) / np.array([0.72, 0.72]) + centre
        )
        colours[cloth] = TABLE_CLOTH
    picture[rows, columns] = colours
    tops[rows, columns] = reached[visible]


class _Clutter:
    """Coloured discs and mats that lie on the floor, of all hues."""

    def __init__(self, scenario: Scenario, count: int, random: np.random.Generator) -> None:
        if count:
            low_x, low_y, high_x, high_y = scenario.bounds
            self._places = random.uniform((low_x, low_y), (high_x, high_y), (count, 2))
        else:
            self._places = np.empty((0, 2))
        self._sizes = random.uniform(0.03, 0.35, (count, 2))
        self._round = random.random(count) < 0.6
        self._colours = [
            255.0 * np.array(colorsys.hsv_to_rgb(hue, saturation, value)[::-1])
            for hue, saturation, value in zip(
                random.random(count),
                random.uniform(0.5, 1.0, count),
                random.uniform(0.4, 1.0, count),
                strict=True,
            )
        ]

    def paint(self, picture: Grid, floor: Grid) -> None:
        """Lay them on the floor of a picture, whose pixels show the places `floor`."""
        x, y = (np.ascontiguousarray(floor[..., axis]) for axis in (0, 1))
        for place, size, is_round, colour in zip(
            self._places, self._sizes, self._round, self._colours, strict=True
        ):
            off_x, off_y = np.abs(x - np.float32(place[0])), np.abs(y - np.float32(place[1]))
            if is_round:
                covered = off_x * off_x + off_y * off_y < size[0] * size[0]
            else:
                covered = (off_x < size[0]) & (off_y < size[1])
            picture[covered] = colour
