"""Velocity limits of the drive, always kept."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.types import Velocity


@dataclass(frozen=True)
class VelocityLimits(Config):
    """How fast the robot may go and how quickly it may change its mind."""

    max_speed: float = parameter(
        0.6, description='Largest forward speed', unit='m/s', above=0.0, high=3.0, dynamic=True
    )
    max_reverse_speed: float = parameter(
        0.1, description='Largest backward speed', unit='m/s', low=0.0, high=1.0, dynamic=True
    )
    max_acceleration: float = parameter(
        0.5, description='Largest gain of speed', unit='m/s^2', above=0.0, dynamic=True
    )
    max_deceleration: float = parameter(
        0.8,
        description='Largest loss of speed when driving',
        unit='m/s^2',
        above=0.0,
        dynamic=True,
    )
    max_turn_rate: float = parameter(
        1.2, description='Largest turn rate', unit='rad/s', above=0.0, high=10.0, dynamic=True
    )
    max_turn_acceleration: float = parameter(
        3.0, description='Largest change of turn rate', unit='rad/s^2', above=0.0, dynamic=True
    )

    def clamp(self, wanted: Velocity) -> Velocity:
        """Return `wanted` within the limits of speed and turn rate.

        Both components shrink together, so that the robot stays on the arc that was asked for. A
        velocity that is not finite becomes standing still.
        """
        linear, angular = wanted.linear_m_s, wanted.angular_rad_s
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return Velocity()
        share = 1.0
        top = self.max_speed if linear >= 0 else self.max_reverse_speed
        if abs(linear) > top:
            share = top / abs(linear)
        if abs(angular) * share > self.max_turn_rate:
            share = self.max_turn_rate / abs(angular)
        turn = self.max_turn_rate
        # Rounding of the share must not put the product past the limit.
        return Velocity(
            min(max(linear * share, -self.max_reverse_speed), self.max_speed),
            min(max(angular * share, -turn), turn),
        )

    def approach(self, current: Velocity, wanted: Velocity, dt: float) -> Velocity:
        """Return the velocity nearest to `wanted` that can be reached from `current` in `dt` [s].

        Losing speed uses the deceleration, gaining it the acceleration; through zero only as far
        as zero in one step.
        """
        target = self.clamp(wanted)
        turn_step = self.max_turn_acceleration * max(dt, 0.0)
        angular = min(
            max(target.angular_rad_s, current.angular_rad_s - turn_step),
            current.angular_rad_s + turn_step,
        )
        return Velocity(self._linear(current.linear_m_s, target.linear_m_s, max(dt, 0.0)), angular)

    def _linear(self, current: float, target: float, dt: float) -> float:
        slowing = current * target < 0 or abs(target) < abs(current)
        if slowing:
            step = self.max_deceleration * dt
            goal = 0.0 if current * target < 0 else target
        else:
            step = self.max_acceleration * dt
            goal = target
        return min(max(goal, current - step), current + step)
