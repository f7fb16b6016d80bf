"""Pictures in, poses of the robots out: what ceiling_camera does with a stream."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.stream import Order, StampOrder
from tablerunner.types import ImageSample, Lens, PoseSample, Refusal, seconds
from tablerunner.vision.ceiling_camera import CameraMount, CeilingCamera
from tablerunner.vision.course import CourseConfig, course, course_variance
from tablerunner.vision.finder import MarkerFinder, Sighting
from tablerunner.vision.marker import MarkerConfig
from tablerunner.vision.picture import picture_fault

IMAGE_SOURCE = 'camera/image_raw'
POSE_SOURCE = 'camera/pose'


@dataclass(frozen=True)
class LocatorConfig(Config):
    """Everything that ceiling_camera lets a user set about seeing."""

    mount: CameraMount = parameter(factory=CameraMount, description='Where the camera hangs')
    marker: MarkerConfig = parameter(factory=MarkerConfig, description='What robots wear')
    course: CourseConfig = parameter(
        factory=CourseConfig, description='The heading of markers that show none'
    )

    def check(self) -> None:
        """Refuse markers that do not hang below the camera."""
        for index, height in enumerate(self.marker.heights):
            if height >= self.mount.height:
                raise ConfigError(
                    f'marker.heights[{index}]',
                    height,
                    f'below the camera, which hangs at {self.mount.height:g} m',
                )


@dataclass(frozen=True, slots=True)
class Observation:
    """What one picture says of one robot: [x, y, heading] with its noise (7).

    Attributes
    ----------
    robot : str
    sample : PoseSample
        base_link in map, with the stamp of the exposure.
    sighting : Sighting
    """

    robot: str
    sample: PoseSample
    sighting: Sighting


class CeilingLocator:
    """Looks for markers in each picture, and remembers their last places for the course."""

    def __init__(self, config: LocatorConfig, lens: Lens) -> None:
        self.config = config
        self.lens = lens
        self._finder = MarkerFinder(config.marker, CeilingCamera(lens, config.mount))
        self._order = StampOrder()
        self._last: dict[str, PoseSample] = {}

    @property
    def camera(self) -> CeilingCamera:
        """The lens where it hangs."""
        return self._finder.camera

    def configure(self, config: LocatorConfig) -> None:
        """Use other settings from now on; another mount makes the maps anew."""
        if config.mount != self.config.mount or config.marker.heights != (
            self.config.marker.heights
        ):
            self._finder = MarkerFinder(config.marker, CeilingCamera(self.lens, config.mount))
        self._finder.config = config.marker
        self.config = config

    def add(self, image: ImageSample) -> tuple[Observation | Refusal, ...]:
        """Return for each robot where it is, or why the picture does not say.

        One refusal with an empty key: the picture as a whole cannot be used.
        """
        fault = 'zero stamp' if image.stamp <= 0 else picture_fault(image.pixels, self.lens)
        if fault:
            return (Refusal(image.stamp, IMAGE_SOURCE, '', fault),)
        order = self._order.judge(image.stamp)
        if order is Order.RESTARTED:
            self._last.clear()
        elif order is not Order.NEWEST:
            return (Refusal(image.stamp, IMAGE_SOURCE, '', order.value),)
        found = self._finder.find(image.pixels)
        return tuple(
            Refusal(image.stamp, POSE_SOURCE, robot, what)
            if isinstance(what, str)
            else self._observe(image.stamp, what)
            for robot, what in found.items()
        )

    def _observe(self, stamp: int, sighting: Sighting) -> Observation:
        sample = PoseSample(stamp, sighting.pose, sighting.covariance, POSE_SOURCE)
        if not math.isfinite(sighting.covariance[2, 2]) and self.config.course.use:
            last = self._last.get(sighting.robot)
            self._last[sighting.robot] = sample
            if last is not None:
                sample = self._with_course(last, sample)
        return Observation(sighting.robot, sample, sighting)

    def _with_course(self, last: PoseSample, now: PoseSample) -> PoseSample:
        """Return a place with the course from the last one as its heading, if that is one."""
        config, disc_x = self.config.course, self.config.marker.disc_x
        dt_s, distance = seconds(now.stamp - last.stamp), last.pose.distance_to(now.pose)
        if dt_s > config.longest_gap or distance < config.least_distance:
            return now
        heading = float(course((last.pose.x, last.pose.y), (now.pose.x, now.pose.y)))
        # The share of the variance that the unknown direction of the mounting has is known now.
        place = float(now.covariance[0, 0]) - disc_x**2 / 2.0
        variance = course_variance(place, place, distance, dt_s, config.turn_rate, disc_x)
        cos, sin = math.cos(heading), math.sin(heading)
        pose = Pose2(now.pose.x - disc_x * cos, now.pose.y - disc_x * sin, heading)
        lever = np.array([disc_x * sin, -disc_x * cos, 1.0])
        covariance = np.diag([place, place, 0.0]) + variance * np.outer(lever, lever)
        return PoseSample(now.stamp, pose, covariance, POSE_SOURCE)
