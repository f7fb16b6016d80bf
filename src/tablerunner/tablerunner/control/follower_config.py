"""How a path is followed and how it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class FollowerConfig(Config):
    """How a path is followed and when it has ended."""

    lookahead_time: float = parameter(
        0.9, description='Look-ahead distance over speed', unit='s', above=0.0, dynamic=True
    )
    lookahead_min: float = parameter(
        0.3, description='Least look-ahead distance', unit='m', above=0.0, dynamic=True
    )
    lookahead_max: float = parameter(
        0.7, description='Largest look-ahead distance', unit='m', above=0.0, dynamic=True
    )
    turn_in_place_above: float = parameter(
        0.9,
        description='Beyond this heading error the robot turns before it drives',
        unit='rad',
        above=0.0,
        high=math.pi,
        dynamic=True,
    )
    turn_until: float = parameter(
        0.25,
        description='Turning in place ends within this heading error',
        unit='rad',
        above=0.0,
        high=math.pi,
        dynamic=True,
    )
    turn_gain: float = parameter(
        2.0, description='Turn rate over heading error', unit='1/s', above=0.0, dynamic=True
    )
    turn_rate_in_place: float = parameter(
        1.2, description='Largest turn rate on the spot', unit='rad/s', above=0.0, dynamic=True
    )
    turn_rate_min: float = parameter(
        0.3, description='Least turn rate on the spot', unit='rad/s', low=0.0, dynamic=True
    )
    lateral_acceleration: float = parameter(
        0.4, description='Largest sideways acceleration', unit='m/s^2', above=0.0, dynamic=True
    )
    crawl_speed: float = parameter(
        0.08, description='Least speed on the last metre', unit='m/s', above=0.0, dynamic=True
    )
    approach_deceleration: float = parameter(
        0.3,
        description='Deceleration towards the end of the path',
        unit='m/s^2',
        above=0.0,
        dynamic=True,
    )
    position_tolerance: float = parameter(
        0.12, description='Arrived within this distance', unit='m', above=0.0, dynamic=True
    )
    heading_tolerance: float = parameter(
        0.12,
        description='Arrived within this heading error',
        unit='rad',
        above=0.0,
        high=math.pi,
        dynamic=True,
    )

    def check(self) -> None:
        """Keep the bounds in their order."""
        if self.lookahead_max < self.lookahead_min:
            raise ConfigError('lookahead_max', self.lookahead_max, 'at least lookahead_min')
        if self.turn_until >= self.turn_in_place_above:
            raise ConfigError('turn_until', self.turn_until, 'less than turn_in_place_above')
