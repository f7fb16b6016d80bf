"""The file of marked points: pixels of one picture, and what is there in the room."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class MarkedPoint(Config):
    """A point of the room and where it is in the picture."""

    pixel: tuple[float, float] = parameter(description='u, v', unit='pixel')
    place: tuple[float, float, float] = parameter(description='x, y, height in map', unit='m')


@dataclass(frozen=True)
class MarkedColour(Config):
    """Points on the discs of one robot's marker."""

    robot: str = parameter(description='name of the robot')
    pixels: tuple[tuple[float, float], ...] = parameter(
        description='u, v on its discs', unit='pixel'
    )
    height: float = parameter(1.15, description='of its marker over the floor', unit='m', low=0.0)


@dataclass(frozen=True)
class PointsFile(Config):
    """Everything that was marked in one picture."""

    points: tuple[MarkedPoint, ...] = parameter((), description='for the pose of the camera')
    markers: tuple[MarkedColour, ...] = parameter((), description='for the colours')

    def check(self) -> None:
        """Refuse a robot named twice."""
        names = [marker.robot for marker in self.markers]
        for index, name in enumerate(names):
            if not name or name in names[:index]:
                raise ConfigError(f'markers[{index}].robot', name, 'each robot once')
