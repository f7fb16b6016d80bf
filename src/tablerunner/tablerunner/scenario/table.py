"""Tables: where meals go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config.parameter import Config, parameter
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import rectangle_corners
from tablerunner.scenario.outline import Outline

_ROUND_CORNERS = 16


@dataclass(frozen=True)
class Table(Config):
    """A rectangular or round table; its size holds the chairs as they stand, pushed in."""

    name: str = parameter(description='name by which meals are sent there')
    x: float = parameter(description='centre in map', unit='m')
    y: float = parameter(description='centre in map', unit='m')
    stop: tuple[float, float, float] = parameter(
        description='x, y, heading of the robot in map when it delivers here', unit='m, m, rad'
    )
    shape: str = parameter(
        'rectangle', description='form of the top', choices=('rectangle', 'round')
    )
    heading: float = parameter(0.0, description='direction of its length', unit='rad')
    length: float = parameter(
        1.2, description='extent along its heading; the diameter when round', unit='m', above=0.0
    )
    width: float = parameter(
        0.8, description='extent across; unused when round', unit='m', above=0.0
    )
    height: float = parameter(0.75, description='height of the top', unit='m', above=0.0)

    @property
    def stop_pose(self) -> Pose2:
        """Where the robot stands in map when it delivers here."""
        return Pose2(*self.stop)

    @property
    def outline(self) -> Outline:
        """Its footprint; a circle becomes a polygon around it of 16 corners."""
        if self.shape == 'round':
            angles = np.arange(_ROUND_CORNERS) * (2 * math.pi / _ROUND_CORNERS)
            radius = self.length / 2 / math.cos(math.pi / _ROUND_CORNERS)
            corners = np.column_stack([np.cos(angles), np.sin(angles)]) * radius
            corners += [self.x, self.y]
        else:
            corners = rectangle_corners(self.x, self.y, self.heading, self.length, self.width)
        return Outline(self.name, 'table', corners, True, self.height)
