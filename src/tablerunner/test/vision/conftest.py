"""A small camera, made once: 320 x 240 pixels, 3.2 m high."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Light, Marker, RobotGeometry, Scenario
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.types import Lens
from tablerunner.vision import CameraMount

RADIUS = 0.25


class Room:
    """A simulated camera over an empty floor, and what is known of it."""

    def __init__(self, **fields: object) -> None:
        camera = Camera((0.0, 0.0, 3.2), focal=(230.0, 230.0), width=320, height=240, **fields)
        self.view = CeilingView(Scenario('x', camera=camera, robot=RobotGeometry()), 1)
        real = self.view.camera
        self.lens = Lens(320, 240, real.focal, real.middle, real.distortion)
        self.mount = CameraMount(real.position, real.yaw, real.tilt)

    def picture(
        self, *poses: Pose2, marker: Marker | None = None, speed: float = 0.0, time_s: float = 0.0
    ) -> np.ndarray:
        """Return a picture of robots that wear the same marker."""
        worn = Marker() if marker is None else marker
        robots = [RobotView(pose, RADIUS, worn, speed) for pose in poses]
        return self.view.draw(time_s, robots)


@pytest.fixture(scope='session')
def room() -> Room:
    return Room()


@pytest.fixture(scope='session')
def make_room() -> Callable[..., Room]:
    return Room


@pytest.fixture(scope='session')
def still_light() -> Light:
    return Light(drift=0.0, tint=0.0, shadows=0)
