"""The markers on the robots' heads: two discs of the robot's own colour on a dark plate.

The larger disc stands behind the smaller one, so that a marker shows where its robot looks. With
`front_radius` zero there is only the larger disc, as in the paper: it shows a place, and the
heading comes from the course.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class MarkerConfig(Config):
    """Whose markers there are, how they look, and what of a picture counts as one."""

    robots: tuple[str, ...] = parameter(
        ('robot',), description='Names of the robots that wear a marker'
    )
    hues: tuple[float, ...] = parameter(
        (330.0,),
        unit='degrees',
        description='Colour of each marker: 0 red, 120 green, 240 blue',
        low=0.0,
        high=360.0,
    )
    heights: tuple[float, ...] = parameter(
        (1.15,), unit='m', description='Height of each marker over the floor', low=0.0, high=100.0
    )
    disc_x: float = parameter(
        -0.06, unit='m', description='Centre of the larger disc in base_link', low=-5.0, high=5.0
    )
    disc_radius: float = parameter(
        0.09, unit='m', description='Radius of the larger disc', above=0.0, high=1.0
    )
    front_x: float = parameter(
        0.14, unit='m', description='Centre of the smaller disc in base_link', low=-5.0, high=5.0
    )
    front_radius: float = parameter(
        0.055,
        unit='m',
        description='Radius of the smaller disc; 0: there is none, the course gives the heading',
        low=0.0,
        high=1.0,
    )
    hue_tolerance: float = parameter(
        18.0,
        unit='degrees',
        description='How far a pixel may be off the colour',
        above=0.0,
        high=60.0,
        dynamic=True,
    )
    least_saturation: float = parameter(
        0.4,
        description='Saturation below which a pixel has no colour',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    least_value: float = parameter(
        0.12,
        description='Brightness below which a pixel has no colour',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    size_tolerance: float = parameter(
        0.1,
        description='How far the radius of a disc may be off, as a share of it',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    roundness_tolerance: float = parameter(
        0.1,
        description=(
            'How much longer than wide a disc may seem, as a share; of few pixels it may seem more'
        ),
        above=0.0,
        high=2.0,
        dynamic=True,
    )
    spacing_tolerance: float = parameter(
        0.05,
        description='How far the distance of the two discs may be off, as a share of it',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    plate_darkness: float = parameter(
        0.35,
        description='Colour that the plate around a disc may have, as a share of the colour of it',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    least_confidence: float = parameter(
        0.3,
        description='Confidence below which a marker is not believed',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    pixel_noise: float = parameter(
        6.0,
        description='Noise of a pixel, in grey levels of 255',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    place_std: float = parameter(
        0.005,
        unit='m',
        description='What the calibration of the camera leaves open of a place',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    heading_std: float = parameter(
        0.01,
        unit='rad',
        description='What the mounting of a marker leaves open of the heading',
        above=0.0,
        high=1.0,
        dynamic=True,
    )

    def check(self) -> None:
        """Refuse lists that do not match, markers that look alike or are no two discs."""
        for name in ('hues', 'heights'):
            if len(getattr(self, name)) != len(self.robots):
                raise ConfigError(
                    name, list(getattr(self, name)), f'{len(self.robots)} numbers, as robots has'
                )
        if len(set(self.robots)) != len(self.robots) or not all(self.robots):
            raise ConfigError('robots', list(self.robots), 'each name once')
        for one, other in itertools.combinations(range(len(self.hues)), 2):
            apart = abs((self.hues[one] - self.hues[other] + 180.0) % 360.0 - 180.0)
            if apart < 2.0 * self.hue_tolerance:
                raise ConfigError(
                    f'hues[{other}]',
                    self.hues[other],
                    f'at least {2 * self.hue_tolerance:g} degrees (twice hue_tolerance) from the '
                    f'{self.hues[one]:g} of {self.robots[one]}',
                )
        if not self.shows_heading:
            return
        if self.front_radius >= self.disc_radius * (1.0 - self.size_tolerance):
            raise ConfigError(
                'front_radius', self.front_radius, 'a disc that cannot pass for the larger one'
            )
        if abs(self.front_x - self.disc_x) <= self.disc_radius + self.front_radius:
            raise ConfigError('front_x', self.front_x, 'a disc beside the larger one')

    @property
    def shows_heading(self) -> bool:
        """Whether there is a second disc."""
        return self.front_radius > 0.0
