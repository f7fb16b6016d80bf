"""Settings of the particle filters of the robot."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.estimation.particles.resampling import RESAMPLERS


@dataclass(frozen=True)
class ParticleConfig(Config):
    """How many particles, and when they are drawn anew."""

    at_start: int = parameter(
        4000,
        description='Particles of a start from anywhere in the room, and most there ever are',
        low=1,
        high=1_000_000,
    )
    least: int = parameter(
        300,
        description='Fewest particles that adaptation goes down to; of a start that is known',
        low=1,
        high=1_000_000,
        dynamic=True,
    )
    adaptive_error: float = parameter(
        0.05,
        description='KLD sampling: largest distance from the density that they stand for',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    adaptive_confidence: float = parameter(
        0.99,
        description='KLD sampling: probability with which it is kept',
        above=0.0,
        high=0.999999,
        dynamic=True,
    )
    bin_side: float = parameter(
        0.25,
        unit='m',
        description='KLD sampling: side of a bin',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    bin_turn: float = parameter(
        0.25,
        unit='rad',
        description='KLD sampling: width of a bin',
        above=0.0,
        high=7.0,
        dynamic=True,
    )
    resampler: str = parameter(
        'systematic',
        description='How particles are resampled',
        choices=tuple(RESAMPLERS),
        dynamic=True,
    )
    threshold: float = parameter(
        0.5,
        description='Share of effective particles below which they are resampled',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    outliers: float = parameter(
        0.02,
        description='Share of measurements whose error is ten times as large as they say',
        low=0.0,
        high=0.5,
        dynamic=True,
    )
    room: tuple[float, ...] = parameter(
        (),
        unit='m',
        description='Where a start from anywhere may be: x and y from, x and y to; empty: anchors',
    )
    room_margin: float = parameter(
        1.0,
        unit='m',
        description='How far beyond the outermost anchors, where no room is given',
        low=0.0,
        high=1000.0,
    )
    seed: int = parameter(
        0, description='Of all random draws; the rest is the stamp', low=0, high=2**31 - 1
    )

    def check(self) -> None:
        """Check the room, and that there are not more at least than at most."""
        if len(self.room) not in (0, 4):
            raise ConfigError('room', self.room, 'nothing, or 4 numbers: x, y from, x, y to [m]')
        if len(self.room) == 4 and not (
            self.room[0] < self.room[2] and self.room[1] < self.room[3]
        ):
            raise ConfigError('room', self.room, 'from smaller than to')
        if self.least > self.at_start:
            raise ConfigError('least', self.least, f'at most at_start, {self.at_start}')
