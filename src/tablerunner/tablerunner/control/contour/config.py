"""How contours are followed and left."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError

LEAVE = ('free', 'nearer')


@dataclass(frozen=True)
class ContourConfig(Config):
    """How a robot goes along the contour of what is in its way, and when it leaves it."""

    leave: str = parameter(
        'free',
        description='Leave where the target direction is free; or nearer than it began, as before',
        choices=LEAVE,
    )
    distance: float = parameter(
        0.35, description='Distance that the side sensor keeps', unit='m', above=0.0
    )
    speed: float = parameter(0.3, description='Speed along a contour', unit='m/s', above=0.0)
    approach_speed: float = parameter(
        0.4,
        description='Largest speed towards the target: between two cones a thing is heard late',
        unit='m/s',
        above=0.0,
    )
    turn_rate: float = parameter(
        1.0, description='Largest turn rate along a contour', unit='rad/s', above=0.0
    )
    notice: float = parameter(
        0.7,
        description='Something so near in the target direction starts contour following',
        unit='m',
        above=0.0,
    )
    patience: float = parameter(
        6.0,
        description='So does a target distance that has not shrunk for this time',
        unit='s',
        above=0.0,
    )
    look: float = parameter(
        2.5,
        description='The target direction must be free up to here, or up to the target',
        unit='m',
        above=0.0,
    )
    gap: float = parameter(
        0.68,
        description='Up to here only where it is nearer than where the contour began',
        unit='m',
        above=0.0,
    )
    half_width: float = parameter(
        0.34, description='Half the width of the strip that must be free', unit='m', above=0.0
    )
    hull_width: float = parameter(
        0.29,
        description='The same of the strip right ahead, which the hull is about to cross',
        unit='m',
        above=0.0,
    )
    free_time: float = parameter(
        0.4, description='For so long before the contour is left', unit='s', low=0.0
    )
    gain: float = parameter(
        0.1,
        description='Nearer than where the contour began is: by this',
        unit='m',
        low=0.0,
    )
    memory: float = parameter(
        3.0, description='Echoes are remembered for this time', unit='s', above=0.0
    )
    same_place: float = parameter(
        0.5, description='Two places nearer than this are one', unit='m', above=0.0
    )
    shortest_round: float = parameter(
        2.5, description='Least way once round anything', unit='m', above=0.0
    )
    position_tolerance: float = parameter(
        0.12, description='Arrived within this distance', unit='m', above=0.0
    )
    stuck_after: float = parameter(
        20.0, description='Standing still for this time ends the drive', unit='s', above=0.0
    )
    longest_way: float = parameter(
        300.0, description='So does a way of this length', unit='m', above=0.0
    )

    def check(self) -> None:
        """Keep the lengths in their order."""
        if self.look < self.notice:
            raise ConfigError('look', self.look, 'at least notice')
        if self.shortest_round <= 2.0 * self.same_place:
            raise ConfigError('shortest_round', self.shortest_round, 'more than twice same_place')
