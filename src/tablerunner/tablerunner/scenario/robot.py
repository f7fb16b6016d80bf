"""The robot's body: wheels, footprint, where its sensors sit, what it can do."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True)
class UltrasonicMount(Config):
    """Where one ultrasonic sensor sits and looks, in base_link."""

    frame: str = parameter(description='frame of the sensor')
    x: float = parameter(description='forward of base_link', unit='m')
    y: float = parameter(description='left of base_link', unit='m')
    heading: float = parameter(description='direction of its axis, counter-clockwise', unit='rad')

    @property
    def name(self) -> str:
        """The sensor's own name, as in its topic: ``left`` for ``ultrasonic_left``."""
        return self.frame.removeprefix('ultrasonic_')

    @property
    def pose(self) -> Pose2:
        """Pose of the sensor in base_link."""
        return Pose2(self.x, self.y, self.heading)


@dataclass(frozen=True)
class AnchorMount(Config):
    """A UWB anchor on the robot, which ranges with tags that people carry."""

    id: str = parameter(description='address that the anchor answers to')
    position: tuple[float, float, float] = parameter(description='antenna in base_link', unit='m')


def _five() -> tuple[UltrasonicMount, ...]:
    """Return the five sensors on the rim of the default footprint (Lv, fig. 4)."""
    places = (
        ('left', 90.0),
        ('left_front', 40.0),
        ('front', 0.0),
        ('right_front', -40.0),
        ('right', -90.0),
    )
    rim = 0.22
    return tuple(
        UltrasonicMount(
            frame=f'ultrasonic_{name}',
            x=round(rim * math.cos(math.radians(degrees)), 4),
            y=round(rim * math.sin(math.radians(degrees)), 4),
            heading=round(math.radians(degrees), 6),
        )
        for name, degrees in places
    )


@dataclass(frozen=True)
class DriveLimits(Config):
    """What the base can do; the controller must stay inside, the simulated base enforces it."""

    speed: float = parameter(0.7, description='highest forward speed', unit='m/s', above=0.0)
    reverse_speed: float = parameter(
        0.2, description='highest backward speed', unit='m/s', low=0.0
    )
    turn_rate: float = parameter(1.5, description='highest turn rate', unit='rad/s', above=0.0)
    acceleration: float = parameter(
        0.6, description='highest forward acceleration', unit='m/s^2', above=0.0
    )
    deceleration: float = parameter(
        1.2, description='highest braking deceleration', unit='m/s^2', above=0.0
    )
    turn_acceleration: float = parameter(
        3.0, description='highest turn acceleration', unit='rad/s^2', above=0.0
    )


@dataclass(frozen=True)
class Marker(Config):
    """Two coloured discs on a dark plate, for the camera under the ceiling."""

    colour: tuple[int, int, int] = parameter(
        (235, 40, 140), description='red, green, blue of the discs', low=0, high=255
    )
    height: float = parameter(
        1.15, description='of the plate over the floor', unit='m', low=0.0, high=10.0
    )
    disc_x: float = parameter(
        -0.06, description='centre of the larger disc in base_link', unit='m'
    )
    disc_radius: float = parameter(
        0.09, description='radius of the larger disc', unit='m', above=0.0
    )
    front_x: float = parameter(
        0.14, description='centre of the smaller disc in base_link', unit='m'
    )
    front_radius: float = parameter(
        0.055, description='radius of the smaller disc; 0: there is none', unit='m', low=0.0
    )
    plate_radius: float = parameter(
        0.24, description='radius of the dark plate about base_link', unit='m', above=0.0
    )

    def check(self) -> None:
        """Refuse discs that the plate does not hold."""
        for name in ('disc', 'front'):
            x, radius = getattr(self, f'{name}_x'), getattr(self, f'{name}_radius')
            if radius > 0.0 and abs(x) + radius > self.plate_radius:
                raise ConfigError(f'{name}_x', x, 'a disc on the plate (plate_radius) [m]')


@dataclass(frozen=True)
class RobotGeometry(Config):
    """A round robot on two driven wheels and a caster (Sun 2019, section 3)."""

    wheel_radius: float = parameter(
        0.06, description='nominal radius of the drive wheels', unit='m', above=0.0
    )
    track: float = parameter(
        0.34, description='nominal distance between the drive wheels', unit='m', above=0.0
    )
    footprint_radius: float = parameter(
        0.25, description='radius of the circle that holds the robot', unit='m', above=0.0
    )
    tag_position: tuple[float, float, float] = parameter(
        (-0.05, 0.0, 1.1), description='UWB tag antenna in base_link', unit='m'
    )
    imu_position: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.1), description='IMU in base_link, axes parallel', unit='m'
    )
    ultrasonic_height: float = parameter(
        0.3, description='height of the ultrasonic sensors over the floor', unit='m', low=0.0
    )
    ultrasonics: tuple[UltrasonicMount, ...] = parameter(
        factory=_five, description='the ultrasonic sensors, in the order in which they fire'
    )
    anchors: tuple[AnchorMount, ...] = parameter(
        (), description='UWB anchors on the robot, for the tags of people'
    )
    marker: Marker | None = parameter(
        None, description='what the camera under the ceiling knows the robot by'
    )
    limits: DriveLimits = parameter(
        factory=DriveLimits, description='speeds and accelerations of the base'
    )

    def check(self) -> None:
        """Refuse sensors that share a frame, and wheels outside the footprint."""
        seen: set[str] = set()
        for index, mount in enumerate(self.ultrasonics):
            if mount.frame in seen:
                raise ConfigError(
                    f'ultrasonics[{index}].frame', mount.frame, 'each sensor frame once'
                )
            seen.add(mount.frame)
        if self.track > 2 * self.footprint_radius:
            raise ConfigError('track', self.track, 'at most twice footprint_radius [m]')
