"""What every path controller offers, so that missions do not care which one drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from tablerunner.control.follower_config import FollowerConfig
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.path import Path
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity


@dataclass(frozen=True, slots=True)
class Drive:
    """One control step.

    Attributes
    ----------
    velocity : Velocity
        What to drive, within the limits.
    distance_left : float
        Along the path to its end [m].
    cross_track : float
        Distance of the robot from the path [m].
    arrived : bool
        Within the tolerances of position and, if the path has one, heading.
    """

    velocity: Velocity
    distance_left: float
    cross_track: float
    arrived: bool


class Controller(Protocol):
    """Drives along a path, one step at a time; deterministic."""

    def follow(self, path: Path) -> None:
        """Take a new path; progress starts at its beginning."""

    def step(self, pose: Pose2, dt: float) -> Drive:
        """Return what to do now; `pose` is base_link in map, `dt` [s] since the last step."""

    def hear(self, readings: Readings) -> None:
        """Take what the ultrasonic sensors hear now; counts for the next step only."""

    def configure(self, config: FollowerConfig, limits: VelocityLimits) -> None:
        """Use other settings from now on."""

    def explain(self, wanted: bool) -> None:
        """Keep the reasons of each step from now on, or no longer."""

    @property
    def traces(self) -> tuple[Trace, ...]:
        """What rule bases decided in the last step; empty where none did or none is asked for."""

    def drive(self, velocity: Velocity) -> None:
        """Take note that this is driven instead of what the last step said: go on from there."""

    def halt(self, dt: float) -> Velocity:
        """Return the next velocity of coming to a stand, whatever the path."""
