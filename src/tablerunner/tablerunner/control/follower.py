"""Regulated pure pursuit with turning in place: the plain path follower.

The look-ahead point of pure pursuit fixes an arc; the speed on it is regulated by the arc's
curvature, by the way left to brake in, and by the velocity limits. docs/navigation.md.
"""

from __future__ import annotations

import math

from tablerunner.control.controller import Drive
from tablerunner.control.follower_config import FollowerConfig
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.path import Path
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity


class PurePursuit:
    """Follows one path at a time; the same inputs in the same order give the same velocities.

    Parameters
    ----------
    config : FollowerConfig
    limits : VelocityLimits
    """

    def __init__(self, config: FollowerConfig, limits: VelocityLimits) -> None:
        self.config = config
        self.limits = limits
        self._path: Path | None = None
        self._arc = 0.0
        self._turning = False
        self._at_end = False
        self._velocity = Velocity()

    def configure(self, config: FollowerConfig, limits: VelocityLimits) -> None:
        """Use other settings from now on."""
        self.config = config
        self.limits = limits

    def hear(self, readings: Readings) -> None:
        """Take readings and leave it at that: the path is all that counts here."""

    def explain(self, wanted: bool) -> None:
        """Leave it at that too: no rules decide here."""

    @property
    def traces(self) -> tuple[Trace, ...]:
        """Nothing: no rules decide here."""
        return ()

    def follow(self, path: Path) -> None:
        """Take a new path; the velocity carries on from the last one."""
        self._path = path
        self._arc = 0.0
        self._turning = False
        self._at_end = False

    def drive(self, velocity: Velocity) -> None:
        """Take note that this is driven instead of what the last step said."""
        self._velocity = velocity

    def halt(self, dt: float) -> Velocity:
        """Return the next velocity of coming to a stand."""
        self._velocity = self.limits.approach(self._velocity, Velocity(), dt)
        return self._velocity

    def step(self, pose: Pose2, dt: float) -> Drive:
        """Return the velocity for a robot at `pose` (base_link in map), `dt` [s] after the last.

        Raises
        ------
        ValueError
            No path was given, or the pose is not finite.
        """
        if self._path is None:
            raise ValueError('there is no path to follow')
        if not pose.is_finite:
            raise ValueError('the pose is not finite')
        path = self._path
        # Progress may step back a little (the pose is corrected), never to another leg.
        self._arc, cross_track = path.project(pose.x, pose.y, self._arc - 0.3, self._arc + 1.0)
        left = path.length - self._arc
        end_x, end_y = path.end
        to_end = math.hypot(end_x - pose.x, end_y - pose.y)
        wanted, arrived = self._at_the_end(pose, path, left, to_end)
        if wanted is None:
            wanted = self._along(pose, path, max(left, 0.0), to_end)
        self._velocity = self.limits.approach(self._velocity, wanted, dt)
        return Drive(self._velocity, max(left, to_end), cross_track, arrived)

    def _at_the_end(
        self, pose: Pose2, path: Path, left: float, to_end: float
    ) -> tuple[Velocity | None, bool]:
        """Return what to do within the position tolerance (None: not there yet), and arrival."""
        tolerance = self.config.position_tolerance
        if self._at_end:
            # Turning to the final heading shifts the estimate a little; do not start over for it.
            self._at_end = to_end <= 2.0 * tolerance
        elif left <= 2.0 * tolerance:
            self._at_end = to_end <= tolerance
        if not self._at_end:
            return None, False
        if path.heading is None:
            return Velocity(), True
        error = difference(path.heading, pose.heading)
        if abs(error) <= self.config.heading_tolerance:
            return Velocity(), True
        return self._turn(error), False

    def _along(self, pose: Pose2, path: Path, left: float, to_end: float) -> Velocity:
        config = self.config
        reach = config.lookahead_time * abs(self._velocity.linear_m_s)
        reach = min(max(reach, config.lookahead_min), config.lookahead_max)
        x, y = path.at(self._arc + reach)
        ahead = math.hypot(x - pose.x, y - pose.y)
        error = difference(math.atan2(y - pose.y, x - pose.x), pose.heading)
        limit = config.turn_until if self._turning else config.turn_in_place_above
        self._turning = abs(error) > limit
        if self._turning:
            return self._turn(error)
        curvature = 2.0 * math.sin(error) / max(ahead, 0.5 * config.lookahead_min)
        speed = self.limits.max_speed
        if curvature:
            speed = min(
                speed,
                math.sqrt(config.lateral_acceleration / abs(curvature)),
                self.limits.max_turn_rate / abs(curvature),
            )
        # Straight at the end of the path even if the end was passed by sideways.
        way = max(left, to_end)
        braking = math.sqrt(2.0 * config.approach_deceleration * way)
        speed = min(speed, max(braking, min(config.crawl_speed, self.limits.max_speed)))
        return Velocity(speed, speed * curvature)

    def _turn(self, error: float) -> Velocity:
        config = self.config
        rate = min(config.turn_gain * abs(error), config.turn_rate_in_place)
        rate = min(max(rate, config.turn_rate_min), self.limits.max_turn_rate)
        return Velocity(0.0, math.copysign(rate, error))
