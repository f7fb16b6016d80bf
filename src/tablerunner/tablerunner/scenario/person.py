"""People who walk about in the room."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError

_ARM_M = 0.6  # how far from the body a hand holds a tag


@dataclass(frozen=True)
class PersonTag(Config):
    """A UWB tag that somebody wears; the anchors on the robot range with it."""

    id: str = parameter(description='address of the tag')
    position: tuple[float, float, float] = parameter(
        (-0.25, 0.0, 1.0),
        description='antenna ahead and left of the middle of the body, and over the floor',
        unit='m',
    )


@dataclass(frozen=True)
class Person(Config):
    """Somebody who walks along a route, there and back or round and round."""

    name: str = parameter(description='who it is')
    route: tuple[tuple[float, float], ...] = parameter(
        description='way points in map; one point: stands there', unit='m'
    )
    loop: bool = parameter(
        False, description='true: from the last point to the first; false: there and back'
    )
    speed: float = parameter(0.8, description='walking speed', unit='m/s', low=0.0, high=3.0)
    radius: float = parameter(
        0.25, description='radius of the body seen from above', unit='m', above=0.0
    )
    height: float = parameter(1.7, description='height', unit='m', above=0.0)
    start_share: float = parameter(
        0.0, description='where on the route the walk begins, as a share of it', low=0.0, high=1.0
    )
    pause: float = parameter(
        2.0, description='mean length of a pause at a way point (exponential)', unit='s', low=0.0
    )
    pause_probability: float = parameter(
        0.5, description='chance of a pause at each way point', low=0.0, high=1.0
    )
    yield_probability: float = parameter(
        0.9,
        description='chance to stop for a robot in the way, drawn once per encounter',
        low=0.0,
        high=1.0,
    )
    yield_distance: float = parameter(
        0.6, description='free space that is kept to a robot in the way', unit='m', low=0.0
    )

    patience: float = parameter(
        3.0, description='wait for a robot in the way before turning back', unit='s', low=0.0
    )
    tag: PersonTag | None = parameter(None, description='UWB tag that the person wears')

    def check(self) -> None:
        """Refuse a route without points or with a point twice in a row, a tag off the body."""
        if self.tag is not None:
            away = math.hypot(*self.tag.position[:2])
            if not (away <= self.radius + _ARM_M and 0.0 <= self.tag.position[2] <= self.height):
                raise ConfigError(
                    'tag.position',
                    list(self.tag.position),
                    f'within {self.radius + _ARM_M:g} m of the middle of the body and '
                    f'{self.height:g} m over the floor',
                )
        if not self.route:
            raise ConfigError('route', [], 'at least one point')
        first = 0 if self.loop and len(self.route) > 1 else 1  # a loop joins last to first
        for index in range(first, len(self.route)):
            if math.dist(self.route[index - 1], self.route[index]) < 1e-6:
                raise ConfigError(
                    f'route[{index}]',
                    list(self.route[index]),
                    'a point apart from the one before it',
                )
