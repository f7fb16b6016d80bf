"""Boxes: counters, refrigerators, pillars and whatever else stands in the way."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.geometry.segments import rectangle_corners
from tablerunner.scenario.outline import Outline


@dataclass(frozen=True)
class Box(Config):
    """An upright block; of iron it bends the magnetic field."""

    name: str = parameter(description='what people call it')
    x: float = parameter(description='centre in map', unit='m')
    y: float = parameter(description='centre in map', unit='m')
    length: float = parameter(description='extent along its heading', unit='m', above=0.0)
    width: float = parameter(description='extent across its heading', unit='m', above=0.0)
    heading: float = parameter(0.0, description='direction of its length', unit='rad')
    height: float = parameter(1.0, description='height over the floor', unit='m', above=0.0)
    magnetic_moment: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), description='magnetic dipole of its iron, in map axes', unit='A m^2'
    )
    unmapped: bool = parameter(
        False, description="true: it stands in the room, but the robot's map does not know it"
    )

    @property
    def outline(self) -> Outline:
        """Its footprint."""
        corners = rectangle_corners(self.x, self.y, self.heading, self.length, self.width)
        return Outline(self.name, 'box', corners, True, self.height)
