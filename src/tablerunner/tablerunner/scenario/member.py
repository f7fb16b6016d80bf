"""One robot of several in a room: what is its own."""

from __future__ import annotations

import colorsys
import re
from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2

_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
_LEAST_SATURATION = 0.4


@dataclass(frozen=True)
class Member(Config):
    """A robot with a name, a place and a colour of its own; the body is that of all."""

    name: str = parameter(description='what it is called; its namespace in ROS')
    start: tuple[float, float, float] = parameter(
        description='x, y, heading at the start in map; there it is loaded, too',
        unit='m, m, rad',
    )
    colour: tuple[int, int, int] | None = parameter(
        None,
        description="red, green, blue of its marker's discs; the marker's when not given",
        low=0,
        high=255,
    )
    tag_id: str = parameter('', description='address of its UWB tag; its name when empty')

    def check(self) -> None:
        """Refuse what is no name in ROS, and a colour that is none."""
        if not _NAME.fullmatch(self.name):
            raise ConfigError('name', self.name, 'letters, digits and _, a letter first')
        if self.colour is not None:
            _, saturation, value = colorsys.rgb_to_hsv(*(part / 255.0 for part in self.colour))
            if saturation < _LEAST_SATURATION or value < _LEAST_SATURATION:
                raise ConfigError('colour', list(self.colour), 'a bright colour, not a grey')

    @property
    def start_pose(self) -> Pose2:
        """Where base_link stands in map at the start."""
        return Pose2(*self.start)

    @property
    def tag(self) -> str:
        """Address of its UWB tag."""
        return self.tag_id or self.name


def hue_of(colour: tuple[int, int, int]) -> float:
    """Return the hue of red, green, blue of 255 [degrees]."""
    return 360.0 * colorsys.rgb_to_hsv(*(part / 255.0 for part in colour))[0]
