"""The camera under the ceiling, and how its pictures come out."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class Light(Config):
    """The light in the room, as the camera takes it."""

    level: float = parameter(1.0, description='brightness; 1: as painted', low=0.0, high=10.0)
    drift: float = parameter(
        0.15, description='how far the brightness goes up and down, as a share', low=0.0, high=1.0
    )
    period: float = parameter(
        20.0, description='time in which it goes up and down', unit='s', above=0.0
    )
    tint: float = parameter(
        0.03,
        description='how far red goes up and blue down with it, as a share',
        low=0.0,
        high=0.9,
    )
    shadows: int = parameter(6, description='number of shadows in the room', low=0, high=100)
    shadow_depth: float = parameter(
        0.4, description='share of the light that the deepest shadow takes', low=0.0, high=1.0
    )


@dataclass(frozen=True)
class Camera(Config):
    """A camera under the ceiling: where the installer measured it to be, and what it is like.

    With yaw and tilt zero it looks straight down, and x of the map is to the right in the picture,
    y upward. Where it really hangs is drawn anew for each seed, from the deviations.
    """

    position: tuple[float, float, float] = parameter(description='pinhole in map', unit='m')
    yaw: float = parameter(0.0, description="direction in map of the picture's x axis", unit='rad')
    tilt: tuple[float, float] = parameter(
        (0.0, 0.0),
        description="turned out of the vertical about the picture's x and y axes",
        unit='rad',
        low=-1.0,
        high=1.0,
    )
    width: int = parameter(640, description='of the picture', unit='pixel', low=16, high=4096)
    height: int = parameter(480, description='of the picture', unit='pixel', low=16, high=4096)
    focal: tuple[float, float] = parameter(
        (400.0, 400.0), description='focal lengths fx, fy', unit='pixel', above=0.0
    )
    centre: tuple[float, float] | None = parameter(
        None, description='cx, cy; the middle of the picture when not given', unit='pixel'
    )
    distortion: tuple[float, float, float, float, float] = parameter(
        (-0.28, 0.09, 0.0006, -0.0004, -0.012), description='k1, k2, p1, p2, k3 of plumb_bob'
    )
    rate: float = parameter(10.0, description='pictures per second', unit='Hz', above=0.0, high=60)
    exposure: float = parameter(
        0.008, description='time over which a picture is exposed', unit='s', low=0.0, high=0.1
    )
    delay: float = parameter(
        0.06,
        description='from the middle of the exposure, which is the stamp, until it is published',
        unit='s',
        low=0.0,
        high=2.0,
    )
    noise: float = parameter(
        4.0, description='noise of each pixel and colour, in grey levels of 255', low=0.0, high=100
    )
    blur: float = parameter(
        0.6, description='deviation of a point in the picture', unit='pixel', low=0.0, high=10.0
    )
    light: Light = parameter(factory=Light, description='brightness, shadows')
    clutter: int = parameter(
        0, description='number of coloured things lying about', low=0, high=1000
    )
    position_std: float = parameter(
        0.003, description='how well the place was measured, by axis', unit='m', low=0.0
    )
    angle_std: float = parameter(
        0.001, description='how well yaw and tilt were', unit='rad', low=0.0, high=0.5
    )
    focal_std: float = parameter(
        0.0005, description='how well the focal length was, as a share', low=0.0, high=0.2
    )

    @property
    def middle(self) -> tuple[float, float]:
        """Where the optical axis meets the picture, cx and cy [pixel]."""
        if self.centre is not None:
            return self.centre
        return (self.width - 1) / 2.0, (self.height - 1) / 2.0

    def check(self) -> None:
        """Refuse a camera in the floor, and a lens that folds the picture onto itself."""
        if self.position[2] <= 0.0:
            raise ConfigError('position[2]', self.position[2], 'a height above 0 [m]')
        reach = math.hypot(
            *(
                max(middle + 0.5, size - 0.5 - middle) / focal
                for middle, size, focal in zip(
                    self.middle, (self.width, self.height), self.focal, strict=True
                )
            )
        )
        k1, k2, _, _, k3 = self.distortion
        largest, radius = 0.0, 0.0
        while largest < reach:
            # Radius in the picture of a ray: it must grow until the corner is reached.
            radius += 0.01
            square = radius * radius
            bent = radius * (1.0 + square * (k1 + square * (k2 + square * k3)))
            if bent <= largest:
                raise ConfigError(
                    'distortion',
                    list(self.distortion),
                    'a lens that still spreads rays at the corner of the picture',
                )
            largest = bent
