"""The simulated base: two driven wheels behind motors that take time and tyres that slip."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import RobotGeometry, WheelErrors
from tablerunner.types import Velocity, nanoseconds


class Drive:
    """Differential drive, stepped in small fixed steps.

    The base limits speed and acceleration of what it is told, turns that into set speeds of the
    wheels by the nominal geometry, each motor follows with a first-order lag, and the floor is
    covered by the true geometry, less what slips. A command older than
    ``WheelErrors.command_timeout`` counts as a command to stand.

    Attributes
    ----------
    left_radius_m, right_radius_m, track_m : float
        True geometry, drawn once; no sensor tells it.
    left_angle_rad, right_angle_rad : float
        True angles of the wheels since the start.
    pose : Pose2
        base_link in map.
    linear_m_s, angular_rad_s : float
        True velocity over the last step.
    """

    def __init__(
        self,
        robot: RobotGeometry,
        errors: WheelErrors,
        start: Pose2,
        random: np.random.Generator,
    ) -> None:
        self._robot = robot
        self._errors = errors
        self._random = random
        scale = 1.0 + random.standard_normal(3) * [
            errors.radius_scale_std,
            errors.radius_scale_std,
            errors.track_scale_std,
        ]
        left, right = errors.radius_scale
        self.left_radius_m = float(robot.wheel_radius * (scale[0] + left))
        self.right_radius_m = float(robot.wheel_radius * (scale[1] + right))
        self.track_m = float(robot.track * scale[2])
        self._timeout_ns = nanoseconds(errors.command_timeout)
        self._command = Velocity()
        self._command_ns: int | None = None
        self._set = Velocity()
        self._speeds = [0.0, 0.0]  # of the wheels [rad/s], left and right
        self._slips = [0.0, 0.0]  # time left of a slip [s]
        self._shares = [0.0, 0.0]  # share of the motion that it loses
        self.left_angle_rad = 0.0
        self.right_angle_rad = 0.0
        self.pose = start
        self.linear_m_s = 0.0
        self.angular_rad_s = 0.0
        self._before = start

    def command(self, now_ns: int, velocity: Velocity) -> bool:
        """Take a command; return False, and keep the last, when it is not finite."""
        if not (math.isfinite(velocity.linear_m_s) and math.isfinite(velocity.angular_rad_s)):
            return False
        self._command = velocity
        self._command_ns = now_ns
        return True

    def is_stale(self, now_ns: int) -> bool:
        """Return whether the last command is too old to be followed."""
        return self._command_ns is None or now_ns - self._command_ns > self._timeout_ns

    def step(self, now_ns: int, dt_s: float) -> None:
        """Move on by `dt_s`."""
        limits = self._robot.limits
        told = Velocity() if self.is_stale(now_ns) else self._command
        linear = min(max(told.linear_m_s, -limits.reverse_speed), limits.speed)
        angular = min(max(told.angular_rad_s, -limits.turn_rate), limits.turn_rate)
        self._set = Velocity(
            _approach(
                self._set.linear_m_s,
                linear,
                limits.acceleration * dt_s,
                limits.deceleration * dt_s,
            ),
            _approach(
                self._set.angular_rad_s,
                angular,
                limits.turn_acceleration * dt_s,
                limits.turn_acceleration * dt_s,
            ),
        )
        self._before = self.pose
        self._roll(dt_s)

    def _roll(self, dt_s: float) -> None:
        robot, lag = self._robot, self._errors.motor_lag
        keep = math.exp(-dt_s / lag) if lag > 0.0 else 0.0
        half = self._set.angular_rad_s * robot.track / 2
        turns = []
        for wheel, rim in ((0, self._set.linear_m_s - half), (1, self._set.linear_m_s + half)):
            wanted = rim / robot.wheel_radius
            behind = self._speeds[wheel] - wanted
            turns.append(wanted * dt_s + behind * lag * (1.0 - keep))  # exact for a held command
            self._speeds[wheel] = wanted + behind * keep
        self.left_angle_rad += turns[0]
        self.right_angle_rad += turns[1]
        shares = self._slip(dt_s, turns)
        noise = self._random.standard_normal(2) * self._errors.floor_noise
        left = turns[0] * self.left_radius_m
        right = turns[1] * self.right_radius_m
        left = left * (1.0 - shares[0]) + math.sqrt(abs(left)) * float(noise[0])
        right = right * (1.0 - shares[1]) + math.sqrt(abs(right)) * float(noise[1])
        self._advance((left + right) / 2, (right - left) / self.track_m, dt_s)

    def _slip(self, dt_s: float, turns: list[float]) -> list[float]:
        """Return the share of its way that each wheel loses in this step."""
        draws = self._random.random(2)
        for wheel in (0, 1):
            self._slips[wheel] -= dt_s
            moving = abs(turns[wheel]) > 1e-5
            if moving and draws[wheel] < self._errors.slip_rate * dt_s:
                self._slips[wheel] = float(self._random.exponential(self._errors.slip_duration))
                self._shares[wheel] = float(self._random.random()) * self._errors.slip_share
        return [
            share if left > 0.0 else 0.0
            for share, left in zip(self._shares, self._slips, strict=True)
        ]

    def _advance(self, way_m: float, turn_rad: float, dt_s: float) -> None:
        """Move along an arc: exact for constant wheel speeds."""
        half = turn_rad / 2
        chord = way_m if abs(half) < 1e-9 else way_m * math.sin(half) / half
        course = self.pose.heading + half
        self.pose = Pose2(
            self.pose.x + chord * math.cos(course),
            self.pose.y + chord * math.sin(course),
            wrap(self.pose.heading + turn_rad),
        )
        self.linear_m_s = way_m / dt_s
        self.angular_rad_s = turn_rad / dt_s

    def block(self) -> None:
        """Undo the last step's way, not its turn: something stands there and the wheels spin."""
        self.pose = Pose2(self._before.x, self._before.y, self.pose.heading)
        self.linear_m_s = 0.0


def _approach(value: float, target: float, gain: float, loss: float) -> float:
    """Return `value` brought towards `target`: by `gain` away from zero, by `loss` back to it."""
    if value * target < 0.0:
        target = 0.0  # first to a stand, then the other way
    step = gain if abs(target) > abs(value) else loss
    return min(max(target, value - step), value + step)
