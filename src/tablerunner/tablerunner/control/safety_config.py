"""When the safety stop slows down and when it stops."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class SafetyConfig(Config):
    """When to slow down and when to stop."""

    footprint_radius: float = parameter(
        0.25, description='Radius of the hull about base_link', unit='m', above=0.0
    )
    command_timeout: float = parameter(
        0.5, description='Stop when the last command is older', unit='s', above=0.0, high=5.0
    )
    ultrasonic_timeout: float = parameter(
        0.5, description='Stop when a sensor was silent for longer', unit='s', above=0.0, high=5.0
    )
    pose_timeout: float = parameter(
        0.5, description='Stop when the pose is older', unit='s', above=0.0, high=5.0
    )
    require_pose: bool = parameter(
        True, description='Whether to drive only while localised', dynamic=True
    )
    position_std_slow: float = parameter(
        0.35,
        description='Slow down when the position is less certain (standard deviation)',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    position_std_stop: float = parameter(
        0.8,
        description='Stop when the position is less certain (standard deviation)',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    heading_std_slow: float = parameter(
        0.5,
        description='Slow down when the heading is less certain (standard deviation)',
        unit='rad',
        above=0.0,
        dynamic=True,
    )
    uncertain_speed: float = parameter(
        0.2, description='Largest speed while uncertain', unit='m/s', above=0.0, dynamic=True
    )
    search_distance: float = parameter(
        6.0,
        description='Stop when driven farther while lost or without a heading',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    delay: float = parameter(
        0.3,
        description='From a reading to the brakes biting: firing, transport, motor lag',
        unit='s',
        low=0.0,
        high=3.0,
        dynamic=True,
    )
    deceleration: float = parameter(
        0.8,
        description='Deceleration that can be relied on',
        unit='m/s^2',
        above=0.0,
        dynamic=True,
    )
    margin: float = parameter(
        0.1,
        description='Distance from hull to obstacle that is left when standing',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    side_margin: float = parameter(
        0.04,
        description='Distance from hull to obstacle beside the way ahead',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    approach_speed: float = parameter(
        1.0,
        description='Speed at which somebody who comes nearer is taken to walk on',
        unit='m/s',
        low=0.0,
        dynamic=True,
    )
    creep_speed: float = parameter(
        0.12,
        description='Speed that is allowed beside things however near they are',
        unit='m/s',
        low=0.0,
        dynamic=True,
    )
    stop_speed: float = parameter(
        0.03,
        description='Where only less than this would be allowed, the robot stands',
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    release_speed: float = parameter(
        0.06,
        description='After a stop, the way is clear when this speed would be allowed',
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    clear_time: float = parameter(
        0.8,
        description='How long the way must be clear after a stop',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    hold_time: float = parameter(
        0.6,
        description='How long an echo counts that is not heard again',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    hold_time_near: float = parameter(
        3.0,
        description='The same for something near: sound may be mirrored away from it',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    memory_time: float = parameter(
        16.0,
        description='The same as long as no sensor looks there again and hears nothing',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    near: float = parameter(
        0.5,
        description='Distance from the hull that counts as near',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    restart_speed: float = parameter(
        0.12,
        description='Largest speed after a stop for something in the way',
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    restart_distance: float = parameter(
        0.4,
        description='Way after a stop up to which that counts',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    turn_rate_near: float = parameter(
        0.6,
        description='Largest turn rate on the spot near things',
        unit='rad/s',
        above=0.0,
        dynamic=True,
    )
    reverse_distance: float = parameter(
        0.3,
        description='Way that may be driven backwards (unseen) before driving forwards again',
        unit='m',
        low=0.0,
        dynamic=True,
    )

    def check(self) -> None:
        """Keep the bounds in their order."""
        if self.position_std_stop < self.position_std_slow:
            raise ConfigError(
                'position_std_stop', self.position_std_stop, 'at least position_std_slow'
            )
        if not self.stop_speed <= self.release_speed <= self.creep_speed:
            raise ConfigError(
                'release_speed', self.release_speed, 'from stop_speed to creep_speed'
            )
