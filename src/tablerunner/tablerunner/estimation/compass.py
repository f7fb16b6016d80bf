"""A heading from the magnetic field, where the field is the earth's.

Indoors the field is bent by iron: by furniture, by motors, by steel in the floor. What iron adds
changes the strength and the dip of the field too, so a reading is taken only where both are those
of the earth at this place. What is left is an error that stays while the robot is near whatever
makes it: readings are thinned out, and each is given a deviation that covers it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.geometry.angles import wrap
from tablerunner.types import HeadingSample, MagneticSample, Refusal, nanoseconds

MAGNETIC_SOURCE = 'imu/mag'


@dataclass(frozen=True)
class CompassConfig(Config):
    """The earth's field at this place, and how much a reading may differ from it."""

    use: bool = parameter(
        False, description='Whether the heading of the magnetic field is used (imu/mag)'
    )
    north: float = parameter(
        0.0,
        unit='rad',
        description='Direction of magnetic north in map',
        low=-math.pi,
        high=math.pi,
    )
    horizontal: float = parameter(
        20e-6, unit='T', description='Horizontal part of the field', above=0.0, high=1e-4
    )
    vertical: float = parameter(
        -44e-6, unit='T', description='Upward part of the field', low=-1e-4, high=1e-4
    )
    tolerance: float = parameter(
        0.1,
        description='Share of the whole field by which either part may differ',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    heading_std: float = parameter(
        0.1,
        unit='rad',
        description='Deviation of a heading from a field that looks right',
        above=0.0,
        high=3.0,
        dynamic=True,
    )
    interval: float = parameter(
        0.5,
        unit='s',
        description='Shortest time between two headings: their errors are alike',
        low=0.0,
        high=60.0,
        dynamic=True,
    )


class Compass:
    """Turns magnetic readings into headings, those of a plausible field."""

    def __init__(self, config: CompassConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget when the last heading was given."""
        self._stamp = 0

    def add(self, sample: MagneticSample) -> HeadingSample | Refusal | None:
        """Return the heading that a reading gives, why it gives none, or None: it is not time."""
        refusal = self._fault(sample)
        if refusal:
            return Refusal(sample.stamp, MAGNETIC_SOURCE, '', refusal)
        if 0 <= sample.stamp - self._stamp < nanoseconds(self.config.interval):
            return None
        self._stamp = sample.stamp
        heading = wrap(self.config.north - math.atan2(sample.field_y_t, sample.field_x_t))
        return HeadingSample(sample.stamp, heading, self.config.heading_std**2, MAGNETIC_SOURCE)

    def _fault(self, sample: MagneticSample) -> str:
        field = (sample.field_x_t, sample.field_y_t, sample.field_z_t)
        if sample.stamp <= 0:
            return 'zero stamp'
        if not all(math.isfinite(part) for part in field):
            return 'field not finite'
        config = self.config
        slack = config.tolerance * math.hypot(config.horizontal, config.vertical)
        horizontal = math.hypot(field[0], field[1])
        if abs(horizontal - config.horizontal) > slack or abs(field[2] - config.vertical) > slack:
            return 'field not plausible'
        return ''
