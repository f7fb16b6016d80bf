"""Walls: polylines of some height."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.scenario.outline import Outline

_SHORTEST_M = 1e-6


@dataclass(frozen=True)
class Wall(Config):
    """A thin upright surface along a polyline, seen from both sides."""

    points: tuple[tuple[float, float], ...] = parameter(
        description='corners of the polyline in map', unit='m'
    )
    name: str = parameter('', description='what people call it')
    closed: bool = parameter(False, description='whether the last corner joins the first')
    height: float = parameter(2.6, description='height over the floor', unit='m', above=0.0)

    def check(self) -> None:
        """Refuse a wall of less than two points or with a part of no length."""
        if len(self.points) < (3 if self.closed else 2):
            least = 'three' if self.closed else 'two'
            raise ConfigError('points', list(self.points), f'at least {least} points')
        following = [*self.points[1:], self.points[0]] if self.closed else self.points[1:]
        for index, (here, there) in enumerate(zip(self.points, following, strict=False)):
            if math.dist(here, there) < _SHORTEST_M:
                where = (index + 1) % len(self.points)
                raise ConfigError(
                    f'points[{where}]', list(there), 'a point apart from the one before it'
                )

    @property
    def outline(self) -> Outline:
        """What of it stands on the floor."""
        corners = np.array(self.points, dtype=float)
        return Outline(self.name or 'wall', 'wall', corners, self.closed, self.height)
