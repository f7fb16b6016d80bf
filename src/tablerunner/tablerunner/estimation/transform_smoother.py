"""Lets the published map -> odom approach the newest one instead of jumping there.

A correction moves map -> odom at once. Whoever draws or drives by the transform may wish it to
move gently: here what is published is the newest one and a deviation that fades,

    deviation(t + dt) = deviation(t) exp(-dt / time constant)

The deviation is that of the robot: of the place [m] and heading [rad] that map -> odom and
odom -> base_link together give it. So a change of heading turns the robot about itself, not about
the origin of odom, which may be far away; and both fade alike, in a straight line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.geometry.angles import difference, wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import seconds


@dataclass(frozen=True)
class SmootherConfig(Config):
    """How gently map -> odom moves."""

    transform_smoothing: float = parameter(
        0.0,
        unit='s',
        description=(
            'Time constant with which the published map to odom approaches the newest one; '
            '0: at once. Other outputs are never smoothed'
        ),
        low=0.0,
        high=10.0,
        dynamic=True,
    )


class TransformSmoother:
    """Remembers what was published last and how far that was from the newest transform."""

    def __init__(self, config: SmootherConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Take the next transform as it is: the estimate began anew, there is no way to it."""
        self._stamp = 0
        self._published: Pose2 | None = None

    def follow(self, stamp: int, map_to_odom: Pose2, pose: Pose2) -> Pose2:
        """Return the map -> odom to publish.

        Parameters
        ----------
        stamp : int
            Of the transform [ns]; one that is not later than the last leaves the deviation.
        map_to_odom : Pose2
            The newest: pose of odom in map.
        pose : Pose2
            The robot by it: base_link in map at `stamp`.
        """
        before, self._published = self._published, map_to_odom
        elapsed = seconds(max(stamp - self._stamp, 0))
        self._stamp = max(stamp, self._stamp)
        time_constant = self.config.transform_smoothing
        if before is None or time_constant <= 0.0:
            return map_to_odom
        in_odom = map_to_odom.between(pose)
        was = before @ in_odom
        left = math.exp(-elapsed / time_constant)
        shown = Pose2(
            pose.x + left * (was.x - pose.x),
            pose.y + left * (was.y - pose.y),
            wrap(pose.heading + left * difference(was.heading, pose.heading)),
        )
        self._published = shown @ in_odom.inverse()
        return self._published
