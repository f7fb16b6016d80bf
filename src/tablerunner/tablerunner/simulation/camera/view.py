"""The camera's picture with all that moves: people, robots and their markers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Marker, Scenario
from tablerunner.simulation.camera.furniture import draw_furniture
from tablerunner.simulation.camera.rays import Rays
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import PersonState

Array = NDArray[np.float64]
Grid = NDArray[np.float32]
Picture = NDArray[np.uint8]

BODY, BODY_TOP, PLATE = (188.0, 190.0, 190.0), (205.0, 205.0, 205.0), (26.0, 24.0, 24.0)
SKIN_AND_HAIR = (48.0, 60.0, 82.0)
HEAD_RADIUS_M, NECK_M = 0.1, 0.28

_FINE = 4
"""A pixel of a marker is looked at on a grid of this many places by this many."""

_BANK = 64
"""Noise is cut out of a larger field, at one of this many places by this many."""


@dataclass(frozen=True, slots=True)
class RobotView:
    """A robot as the camera sees it."""

    pose: Pose2  # base_link in map, at the middle of the exposure
    radius_m: float
    marker: Marker | None
    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    height_m: float = 1.1  # where there is no marker


class CeilingView:
    """Draws pictures of a scenario; the same seed and the same calls give the same pictures.

    Attributes
    ----------
    camera : Camera
        As it really hangs: drawn from the seed about the one of the scenario.

    Parameters
    ----------
    scenario : Scenario
        With a camera.
    seed : int
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        if scenario.camera is None:
            raise ValueError('the scenario has no camera')
        self.camera = real_camera(scenario.camera, stream(seed, 'camera mount'))
        self.rays = Rays(self.camera)
        random = stream(seed, 'camera scene')
        still = draw_furniture(scenario, self.rays, random)
        self._still, self._tops = still.picture.clip(0.0, 255.0).astype(np.uint8), still.tops
        self._foot = np.array(self.camera.position[:2], dtype=np.float32)
        self._across, self._down = (np.gradient(self.rays.slopes, axis=axis) for axis in (1, 0))
        self._shade = _shadows(self.camera, random)
        self._phase = float(random.uniform(0.0, 2.0 * math.pi))
        self._clothes = random.uniform(30.0, 220.0, (max(len(scenario.people), 1), 3))
        self._heights = [person.height for person in scenario.people]
        self._random = stream(seed, 'camera noise')
        size = (self.camera.height + _BANK, self.camera.width + _BANK, 3)
        noise = self.camera.noise * self._random.standard_normal(size, dtype=np.float32)
        self._noise = np.rint(noise).astype(np.int16)

    def draw(
        self, time_s: float, robots: Sequence[RobotView], people: Sequence[PersonState] = ()
    ) -> Picture:
        """Return the picture of a moment, shape (height, width, 3): blue, green, red.

        Parameters
        ----------
        time_s : float
            For the light.
        robots : sequence of RobotView
        people : sequence of PersonState
            Those of the scenario, in its order.
        """
        picture, tops = self._still.copy(), self._tops.copy()
        for index, (person, height) in enumerate(zip(people, self._heights, strict=False)):
            place, clothes = (person.pose.x, person.pose.y), self._clothes[index]
            shoulders = height - NECK_M
            self._column(picture, tops, place, person.radius_m, shoulders, clothes, clothes * 0.9)
            self._column(picture, tops, place, HEAD_RADIUS_M, height, SKIN_AND_HAIR, SKIN_AND_HAIR)
        for robot in robots:
            place = (robot.pose.x, robot.pose.y)
            height = robot.height_m if robot.marker is None else robot.marker.height
            self._column(picture, tops, place, robot.radius_m, height, BODY, BODY_TOP)
            if robot.marker is not None:
                self._mark(picture, tops, robot, robot.marker)
        return self._expose(picture, time_s)

    def _window(
        self, place: tuple[float, float], radius: float, height: float
    ) -> tuple[slice, slice]:
        """Return rows and columns that hold an upright column; empty where it is out of sight."""
        angles = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
        rim = 1.1 * radius * np.column_stack([np.cos(angles), np.sin(angles)]) + place
        points = np.concatenate(
            [np.column_stack([rim, np.full(len(rim), z)]) for z in (0.0, height)]
        )
        offset = points - np.array(self.camera.position)
        slopes = offset[:, :2] / -offset[:, 2:]
        edge = np.abs(self.rays.slopes[[0, 0, -1, -1], [0, -1, 0, -1]]).max(axis=0)
        # Far beyond the picture the lens's model bends rays back into it.
        seen = np.all(np.abs(slopes) < 1.3 * edge + 0.2, axis=1)
        if not seen.any():
            return slice(0), slice(0)
        pixels = self.rays.project(points[seen])
        low, high = np.floor(pixels.min(axis=0)) - 2, np.ceil(pixels.max(axis=0)) + 3
        if not seen.all():  # partly out of sight: take it up to the border
            low, high = np.minimum(low, 0.0), np.maximum(high, max(self._tops.shape))
        first = np.clip(low, 0, None).astype(int)
        last = np.clip(high, 0, [self.camera.width, self.camera.height]).astype(int)
        return slice(first[1], last[1]), slice(first[0], last[0])

    def _column(
        self,
        picture: Picture,
        tops: Grid,
        place: tuple[float, float],
        radius: float,
        height: float,
        side: Sequence[float] | Array,
        top: Sequence[float] | Array,
    ) -> None:
        """Draw an upright round column where nothing nearer to the camera hides it."""
        window = self._window(place, radius, height)
        slopes, high = self.rays.slopes[window], self.camera.position[2]
        if not slopes.size:
            return
        upper = self._foot + slopes * np.float32(high - height)
        start = upper - np.array(place, dtype=np.float32)
        way = slopes * np.float32(height)
        # |start + t way| = radius, first t in 0..1.
        a = np.sum(way**2, axis=-1) + 1e-12
        b = np.sum(start * way, axis=-1)
        c = np.sum(start**2, axis=-1) - radius * radius
        root = b * b - a * c
        share = np.where(root > 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
        inside = c <= 0.0
        share = np.where(inside, 0.0, share)
        reached = np.where((share >= 0.0) & (share <= 1.0), height * (1.0 - share), -1.0)
        visible = reached > tops[window]
        tops[window][visible] = reached[visible]
        # The round side is lit from one direction.
        lit = 0.55 + 0.15 * (start[..., 0] + share * way[..., 0]) / radius
        colours = np.where(
            inside[..., None],
            np.asarray(top),
            np.clip(lit, 0.3, 0.8)[..., None] * np.asarray(side),
        )
        picture[window][visible] = colours[visible].astype(np.uint8)

    def _mark(self, picture: Picture, tops: Grid, robot: RobotView, marker: Marker) -> None:
        """Draw a marker, each pixel by what it covers of it while the picture is exposed."""
        window = self._window((robot.pose.x, robot.pose.y), marker.plate_radius, marker.height)
        drop = np.float32(self.camera.position[2] - marker.height)
        places = self._foot + self.rays.slopes[window] * drop
        if not places.size:
            return
        offset = places - np.array((robot.pose.x, robot.pose.y), dtype=np.float32)
        reach = marker.plate_radius + 2.0 * float(np.abs(self._across[window] * drop).max())
        close = np.hypot(offset[..., 0], offset[..., 1]) < reach
        close &= tops[window] <= marker.height + 1e-3
        centre = offset[close].astype(float)
        across, down = (grid[window][close] * drop for grid in (self._across, self._down))
        shares = np.zeros((2, len(centre)))
        steps = (np.arange(_FINE) + 0.5) / _FINE - 0.5
        for row, below in enumerate(steps):
            for column, right in enumerate(steps):
                # Four instants, each looked at from four places spread over the pixel.
                instant = ((row % 2) * 2 + column % 2 + 0.5) / 4.0 - 0.5
                on_plate, on_disc = _covered(
                    centre + right * across + below * down,
                    robot,
                    marker,
                    instant * self.camera.exposure,
                )
                shares += on_plate, on_disc
        shares /= _FINE**2
        plate, disc = shares[0][:, None], shares[1][:, None]
        colour = np.array(marker.colour[::-1], dtype=float)
        before = picture[window][close]
        mixed = (1.0 - plate) * before + (plate - disc) * np.array(PLATE) + disc * colour
        picture[window][close] = np.rint(mixed).astype(np.uint8)

    def _expose(self, picture: Picture, time_s: float) -> Picture:
        camera, light = self.camera, self.camera.light
        wave = math.sin(2.0 * math.pi * time_s / light.period + self._phase)
        gain = light.level * (1.0 + light.drift * wave)
        tint = light.tint * wave
        grey = np.arange(256.0)[:, None] * gain * np.array([1.0 - tint, 1.0, 1.0 + tint])
        table = np.rint(np.clip(grey, 0.0, 255.0)).astype(np.uint8).reshape(1, 256, 3)
        lit = picture
        if self._shade is not None:
            lit = np.asarray(cv2.multiply(lit, self._shade, scale=1.0 / 255.0), dtype=np.uint8)
        lit = np.asarray(cv2.LUT(lit, table), dtype=np.uint8)
        if camera.blur > 0.0:
            lit = np.asarray(cv2.GaussianBlur(lit, (0, 0), camera.blur), dtype=np.uint8)
        row, column = self._random.integers(0, _BANK, 2)
        if camera.noise > 0.0:
            noise = self._noise[row : row + camera.height, column : column + camera.width]
            lit = np.asarray(cv2.add(lit, noise, dtype=cv2.CV_8U), dtype=np.uint8)
        return lit


def real_camera(camera: Camera, random: np.random.Generator) -> Camera:
    """Return a camera as it really hangs, about the one that was measured."""
    draws = random.standard_normal(7)
    moved = camera.position_std * draws[:3]
    turned = camera.angle_std * draws[3:6]
    longer = 1.0 + camera.focal_std * float(draws[6])
    x, y, z = (float(a + b) for a, b in zip(camera.position, moved, strict=True))
    return camera.replace(
        position=(x, y, z),
        yaw=camera.yaw + float(turned[0]),
        tilt=(camera.tilt[0] + float(turned[1]), camera.tilt[1] + float(turned[2])),
        focal=(camera.focal[0] * longer, camera.focal[1] * longer),
    )


def _covered(
    places: Array, robot: RobotView, marker: Marker, later_s: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which places, from where the robot is at mid-exposure, are on plate and discs."""
    heading = robot.pose.heading + robot.angular_rad_s * later_s
    middle = robot.pose.heading + robot.angular_rad_s * later_s / 2.0
    way = robot.linear_m_s * later_s
    x = places[:, 0] - way * math.cos(middle)
    y = places[:, 1] - way * math.sin(middle)
    cos, sin = math.cos(heading), math.sin(heading)
    ahead, left = cos * x + sin * y, cos * y - sin * x
    side = left * left
    on_plate = ahead * ahead + side < marker.plate_radius**2
    on_disc = (ahead - marker.disc_x) ** 2 + side < marker.disc_radius**2
    on_disc |= (ahead - marker.front_x) ** 2 + side < marker.front_radius**2
    return on_plate, on_disc


def _shadows(camera: Camera, random: np.random.Generator) -> Picture | None:
    """Return how much light falls where in the picture, of 255; None for the same everywhere."""
    light = camera.light
    size = (camera.width, camera.height)
    middles = random.uniform((0.0, 0.0), size, (light.shadows, 2))
    widths = random.uniform(0.08, 0.3, (light.shadows, 2)) * camera.width
    depths = light.shadow_depth * random.uniform(0.4, 1.0, light.shadows)
    if not light.shadows or light.shadow_depth == 0.0:
        return None
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    shade = np.ones((camera.height, camera.width))
    for middle, width, depth in zip(middles, widths, depths, strict=True):
        off = ((columns - middle[0]) / width[0]) ** 2 + ((rows - middle[1]) / width[1]) ** 2
        # Flat inside, with a soft rim.
        shade *= 1.0 - depth / (1.0 + np.exp(12.0 * (off - 1.0).clip(-4.0, 4.0)))
    grey = np.rint(255.0 * shade).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)
