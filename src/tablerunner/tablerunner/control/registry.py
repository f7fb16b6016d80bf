"""The path controllers by name."""

from __future__ import annotations

from dataclasses import dataclass, field

from tablerunner.control.contour import ContourConfig
from tablerunner.control.controller import Controller
from tablerunner.control.follower import PurePursuit
from tablerunner.control.follower_config import FollowerConfig
from tablerunner.control.fuzzy.reactive import ReactiveConfig
from tablerunner.control.fuzzy.readings import FRAMES
from tablerunner.control.fuzzy.track_keeper import TrackConfig
from tablerunner.control.fuzzy_controller import DetourConfig, FuzzyController
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.room import sensor_mounts
from tablerunner.errors import ConfigError
from tablerunner.scenario import RobotGeometry

CONTROLLERS = ('fuzzy', 'pure_pursuit')
"""Their names; the first is the default."""


@dataclass(frozen=True)
class ControllerSettings:
    """What the controllers are set to; each takes what concerns it.

    Attributes
    ----------
    follower : FollowerConfig
        How paths end, for all; how they are followed, for pure pursuit.
    track : TrackConfig
        The corridor of the fuzzy controller.
    reactive : ReactiveConfig
        Its rule bases.
    contour : ContourConfig
        How it follows the contour of what stands in the way.
    detour : DetourConfig
        When it leaves the path for that.
    """

    follower: FollowerConfig = field(default_factory=FollowerConfig)
    track: TrackConfig = field(default_factory=TrackConfig)
    reactive: ReactiveConfig = field(default_factory=ReactiveConfig)
    contour: ContourConfig = field(default_factory=ContourConfig)
    detour: DetourConfig = field(default_factory=DetourConfig)


def make_controller(
    name: str,
    limits: VelocityLimits,
    robot: RobotGeometry,
    settings: ControllerSettings | None = None,
    frames: tuple[str, ...] = FRAMES,
) -> Controller:
    """Return a new path controller.

    Parameters
    ----------
    name : str
        One of `CONTROLLERS`.
    limits : VelocityLimits
    robot : RobotGeometry
        Its sensors and the distance between its wheels.
    settings : ControllerSettings, optional
    frames : tuple of str
        Of the five ultrasonic sensors, in the order of `SENSORS`.

    Raises
    ------
    ConfigError
        There is no controller of this name, or the robot lacks one of the five sensors.
    """
    chosen = settings or ControllerSettings()
    if name == 'pure_pursuit':
        return PurePursuit(chosen.follower, limits)
    if name != 'fuzzy':
        raise ConfigError('controller', name, f'one of {", ".join(CONTROLLERS)}')
    mounts = sensor_mounts(robot)
    missing = [frame for frame in frames if frame not in mounts]
    if missing:
        raise ConfigError(
            'robot.ultrasonics', ', '.join(mounts) or 'none', f'{", ".join(missing)} for fuzzy'
        )
    return FuzzyController(
        limits,
        tuple(mounts[frame] for frame in frames),
        robot.track,
        chosen.follower,
        chosen.detour,
        chosen.track,
        chosen.reactive,
        chosen.contour,
    )


def configure_controller(
    controller: Controller, limits: VelocityLimits, settings: ControllerSettings
) -> None:
    """Let a controller use other limits and settings from now on, whatever it is doing.

    What is not marked as dynamic stays as it was made.
    """
    controller.configure(settings.follower, limits)
    if isinstance(controller, FuzzyController):
        controller.tune(settings.track, settings.reactive)
