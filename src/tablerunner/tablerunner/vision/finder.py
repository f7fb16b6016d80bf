"""Each robot's marker in a picture, and what it says of the robot's pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Matrix
from tablerunner.vision.blobs import Blob, blobs_of, colour_masks
from tablerunner.vision.ceiling_camera import CeilingCamera
from tablerunner.vision.ground_map import GroundMap, ground_map
from tablerunner.vision.marker import MarkerConfig

UNSEEN = 'no marker seen'
DOUBLE = 'two markers of one colour'
AT_BORDER = 'marker at the border of the picture'

RIVAL = 0.5
"""A second marker of a colour makes the first doubtful from this share of its confidence."""

NEAR = 2.0
"""How far beyond the tolerance a patch is still measured, as a factor."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """A marker that was found.

    Attributes
    ----------
    robot : str
    pose : Pose2
        Of base_link in map; heading 0 where the marker shows none.
    covariance : ndarray, shape (3, 3)
        Of x, y, heading; ``inf`` for a heading that is not shown.
    confidence : float
        1 for a marker just as it should look, towards 0 for one that hardly passes.
    places : tuple of (x, y)
        Centres of its discs in map, the larger first [m].
    """

    robot: str
    pose: Pose2
    covariance: Matrix
    confidence: float
    places: tuple[tuple[float, float], ...]


class MarkerFinder:
    """Looks for every robot's marker; made once for a camera, since its maps take a while.

    Raises
    ------
    ConfigError
        A marker is not below the camera.
    """

    def __init__(self, config: MarkerConfig, camera: CeilingCamera) -> None:
        self.config = config
        self.camera = camera
        for index, height in enumerate(config.heights):
            if height >= camera.mount.height:
                raise ConfigError(
                    f'heights[{index}]',
                    height,
                    f'below the camera, which hangs at {camera.mount.height:g} m',
                )
        maps = {height: ground_map(camera, height) for height in set(config.heights)}
        self._grounds: tuple[GroundMap, ...] = tuple(maps[height] for height in config.heights)

    def find(self, picture: NDArray[np.uint8]) -> dict[str, Sighting | str]:
        """Return for each robot its marker, or in words why there is none.

        Parameters
        ----------
        picture : ndarray of uint8, shape (height, width, 3)
            Blue, green, red; of the size of the camera's lens.
        """
        config = self.config
        masks = colour_masks(picture, config)
        found: dict[str, Sighting | str] = {}
        small = config.front_radius if config.shows_heading else config.disc_radius
        wide = NEAR * config.size_tolerance
        radii = (small * (1.0 - min(wide, 0.8)), config.disc_radius * (1.0 + wide))
        for robot, mask, ground in zip(config.robots, masks, self._grounds, strict=True):
            blobs = blobs_of(picture, mask, ground, config.pixel_noise, radii)
            found[robot] = self._choose(robot, blobs)
        return found

    def _choose(self, robot: str, blobs: list[Blob]) -> Sighting | str:
        """Return the one marker among the patches of a colour."""
        whole = [blob for blob in blobs if not blob.at_border]
        found = sorted(
            self._markers(robot, whole), key=lambda sighting: sighting.confidence, reverse=True
        )
        found = [item for item in found if item.confidence >= self.config.least_confidence]
        if not found:
            return AT_BORDER if len(whole) < len(blobs) else UNSEEN
        rivals = [item for item in found[1:] if item.confidence > RIVAL * found[0].confidence]
        return DOUBLE if rivals else found[0]

    def _markers(self, robot: str, blobs: list[Blob]) -> list[Sighting]:
        config = self.config
        discs = [(blob, self._likeness(blob, config.disc_radius)) for blob in blobs]
        discs = [(blob, likeness) for blob, likeness in discs if likeness > 0.0]
        if not config.shows_heading:
            return [_of_disc(robot, blob, likeness, config) for blob, likeness in discs]
        fronts = [(blob, self._likeness(blob, config.front_radius)) for blob in blobs]
        found = []
        for disc, likeness in discs:
            for front, other in fronts:
                if other <= 0.0 or front is disc:
                    continue
                spacing = math.dist(disc.place, front.place)
                wanted = abs(config.front_x - config.disc_x)
                off = (spacing - wanted) / (wanted * config.spacing_tolerance)
                if abs(off) <= 1.0:
                    all_in_all = likeness * other * _score(off)
                    found.append(_of_pair(robot, disc, front, all_in_all, config))
        return found

    def _likeness(self, blob: Blob, radius: float) -> float:
        """Return how much a patch looks like a disc of a radius: 1, and 0 beyond tolerances."""
        config = self.config
        offs = (
            (blob.radius / radius - 1.0) / config.size_tolerance,
            # A disc of few pixels is never quite round.
            (blob.elongation - 1.0) / (config.roundness_tolerance + blob.grain**2),
            blob.surround / config.plate_darkness,
        )
        if any(abs(off) > 1.0 for off in offs):
            return 0.0
        return math.prod(_score(off) for off in offs)


def _score(off: float) -> float:
    """Return 1 for nothing off, 0.6 at the limit of a tolerance."""
    return math.exp(-0.5 * off * off)


def _of_disc(robot: str, disc: Blob, confidence: float, config: MarkerConfig) -> Sighting:
    """Return what a lone disc says: a place, off base_link by its mounting in some direction."""
    variance = disc.variance + config.place_std**2 + config.disc_x**2 / 2.0
    covariance = np.diag([variance, variance, math.inf])
    return Sighting(robot, Pose2(*disc.place), covariance, confidence, (disc.place,))


def _of_pair(
    robot: str, disc: Blob, front: Blob, confidence: float, config: MarkerConfig
) -> Sighting:
    """Return the pose that fits two discs best, with its covariance.

    Weighted by their variances, the mean c of the two places is independent of their direction
    a; base_link is at c - m (cos a, sin a), with m the same mean of the discs on the robot.
    """
    first, second = np.array(disc.place), np.array(front.place)
    weights = np.array([1.0 / disc.variance, 1.0 / front.variance])
    weights /= weights.sum()
    middle = weights[0] * first + weights[1] * second
    mounted = float(weights @ [config.disc_x, config.front_x])
    ahead = second - first if config.front_x > config.disc_x else first - second
    heading = math.atan2(ahead[1], ahead[0])
    cos, sin = math.cos(heading), math.sin(heading)
    place = middle - mounted * np.array([cos, sin])
    turned = (disc.variance + front.variance) / float(ahead @ ahead) + config.heading_std**2
    shared = disc.variance * front.variance / (disc.variance + front.variance)
    lever = np.array([mounted * sin, -mounted * cos, 1.0])  # d(x, y, heading)/d(heading)
    covariance = np.diag([shared + config.place_std**2] * 2 + [0.0])
    covariance += turned * np.outer(lever, lever)
    pose = Pose2(float(place[0]), float(place[1]), heading)
    return Sighting(robot, pose, covariance, confidence, (disc.place, front.place))
