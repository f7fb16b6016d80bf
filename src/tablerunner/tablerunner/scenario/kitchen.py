"""The kitchen: where meals come from and the robot lives."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True)
class Kitchen(Config):
    """The place where the robot is loaded; its walls stand among the walls of the room."""

    stop: tuple[float, float, float] = parameter(
        description='x, y, heading of the robot in map when it is loaded', unit='m, m, rad'
    )
    name: str = parameter('kitchen', description='name by which the robot is sent there')

    @property
    def stop_pose(self) -> Pose2:
        """Where the robot stands in map when it is loaded."""
        return Pose2(*self.stop)
