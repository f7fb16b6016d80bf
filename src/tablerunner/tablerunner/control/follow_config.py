"""How a person is followed."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.control.braking import stopping_distance
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class FollowConfig(Config):
    """Set distance and speed, when the person is lost, and when to give up."""

    distance: float = parameter(
        1.2,
        description='From base_link to the tag of the person',
        unit='m',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    speed: float = parameter(
        0.6, description='Largest speed behind a person', unit='m/s', above=0.0, dynamic=True
    )
    gain: float = parameter(
        0.8, description='Speed over error of the distance', unit='1/s', above=0.0, dynamic=True
    )
    turn_gain: float = parameter(
        1.5, description='Turn rate over bearing', unit='1/s', above=0.0, dynamic=True
    )
    corner_cut: float = parameter(
        0.4,
        description='How far the straight line to the person may leave the way the person walked',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    trail_std: float = parameter(
        0.4,
        description='A place less certain than this is not put to that way',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    seek_speed: float = parameter(
        0.3,
        description='Largest speed to where the person was last seen; 0: waits where it is',
        unit='m/s',
        low=0.0,
        dynamic=True,
    )
    start_margin: float = parameter(
        0.15,
        description='A robot that stands starts when the person is farther than set by this',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    face_within: float = parameter(
        0.35,
        description='A robot that stands turns to a person who is farther aside than this',
        unit='rad',
        above=0.0,
        dynamic=True,
    )
    turn_in_place_above: float = parameter(
        1.0,
        description='Where the person is farther aside than this the robot turns on the spot',
        unit='rad',
        above=0.0,
        high=3.2,
        dynamic=True,
    )
    person_radius: float = parameter(
        0.3, description='What is heard so near the tag is the person', unit='m', above=0.0
    )
    notice: float = parameter(
        0.8,
        description='What is heard nearer than this, and is not the person, is gone round',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    reach: float = parameter(
        6.0,
        description='A person farther away than this is out of reach',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    position_std: float = parameter(
        0.8,
        description='A person whose place is less certain than this is not in sight',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    bearing_std: float = parameter(
        0.35,
        description='Far away, where a direction that is certain within this is enough',
        unit='rad',
        above=0.0,
        high=1.5,
        dynamic=True,
    )
    give_up_after: float = parameter(
        30.0,
        description='Gives up when the person was out of sight for longer',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    stuck_after: float = parameter(
        30.0,
        description='Gives up when it came no nearer to a person who stands for longer',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    look_every: float = parameter(
        8.0, description='Time from one look around to the next', unit='s', low=4.0
    )

    def check(self) -> None:
        """Keep the person within reach at the set distance."""
        if self.distance + self.start_margin >= self.reach:
            raise ConfigError(
                'distance', self.distance, f'less than reach, {self.reach:g} m, and start_margin'
            )


def least_distance(safety: SafetyConfig, person_radius: float) -> float:
    """Return the set distance up to which the safety stop may never let the robot go [m].

    The tag may hang on the far side of the body, so that hull and body are nearer than base_link
    and tag by the hull's radius and the body's diameter. Beyond the stop's own margin there must
    be room enough for the speed from which it lets a robot start again.
    """
    room = stopping_distance(safety.release_speed, safety.delay, safety.deceleration)
    return safety.footprint_radius + 2.0 * person_radius + safety.margin + room
