"""The bases of many robots: `simulation.drive.Drive` over arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.scenario import RobotGeometry, WheelErrors
from tablerunner.simulation.fleet.draws import Draws
from tablerunner.simulation.streams import stream

Array = NDArray[np.float64]

_ROLLS_RAD = 1e-5  # a wheel that turns less in a step does not slip


class FleetBase:
    """Differential drives, stepped together; a command comes with every step.

    Attributes
    ----------
    radius_m : ndarray, shape (2, runs)
        True radii of the left and the right wheels: those of the one-robot `Drive` of that seed.
    track_m : ndarray, shape (runs,)
    angle_rad : ndarray, shape (2, runs)
        True angles of the wheels since the start.
    x, y, heading : ndarray, shape (runs,)
        base_link in map.
    turn_rad : ndarray, shape (runs,)
        Turn of the last step.
    """

    def __init__(
        self,
        robot: RobotGeometry,
        errors: WheelErrors,
        start: tuple[float, float, float],
        seeds: Sequence[int],
    ) -> None:
        self._robot, self._errors = robot, errors
        runs = len(seeds)
        generators = [stream(seed, 'drive') for seed in seeds]
        scale = 1.0 + np.array([generator.standard_normal(3) for generator in generators]).T * [
            [errors.radius_scale_std],
            [errors.radius_scale_std],
            [errors.track_scale_std],
        ]
        self.radius_m = robot.wheel_radius * (scale[:2] + np.array(errors.radius_scale)[:, None])
        self.track_m = robot.track * scale[2]
        self._draws = Draws(generators, normals=2, uniforms=2, block=128)
        self._slip_streams = [stream(seed, 'slips') for seed in seeds]
        self._set_linear, self._set_angular = np.zeros(runs), np.zeros(runs)
        self._speeds = np.zeros((2, runs))  # of the wheels [rad/s]
        self._slips = np.zeros((2, runs))  # time left of a slip [s]
        self._shares = np.zeros((2, runs))  # share of the motion that it loses
        self.angle_rad = np.zeros((2, runs))
        self.x, self.y = np.full(runs, start[0]), np.full(runs, start[1])
        self.heading = np.full(runs, start[2])
        self.turn_rad = np.zeros(runs)

    def step(self, linear: Array, angular: Array, dt_s: float) -> None:
        """Follow the commands [m/s], [rad/s], shape (runs,), for `dt_s`."""
        limits = self._robot.limits
        linear = np.clip(linear, -limits.reverse_speed, limits.speed)
        angular = np.clip(angular, -limits.turn_rate, limits.turn_rate)
        gain, loss = limits.acceleration * dt_s, limits.deceleration * dt_s
        spin = limits.turn_acceleration * dt_s
        self._set_linear = _approach(self._set_linear, linear, gain, loss)
        self._set_angular = _approach(self._set_angular, angular, spin, spin)
        self._roll(dt_s)

    def _roll(self, dt_s: float) -> None:
        robot, lag = self._robot, self._errors.motor_lag
        keep = math.exp(-dt_s / lag) if lag > 0.0 else 0.0
        half = self._set_angular * (robot.track / 2)
        wanted = np.stack([self._set_linear - half, self._set_linear + half]) / robot.wheel_radius
        behind = self._speeds - wanted
        turns = wanted * dt_s + behind * (lag * (1.0 - keep))  # exact for a held command
        self._speeds = wanted + behind * keep
        self.angle_rad = self.angle_rad + turns
        normals, uniforms = self._draws.row()
        ways = turns * self.radius_m
        noise = np.sqrt(np.abs(ways)) * normals * self._errors.floor_noise
        ways = ways * (1.0 - self._slip(dt_s, turns, uniforms)) + noise
        self._advance((ways[0] + ways[1]) / 2, (ways[1] - ways[0]) / self.track_m)

    def _slip(self, dt_s: float, turns: Array, draws: Array) -> Array:
        """Return the share of its way that each wheel loses in this step, shape (2, runs)."""
        errors = self._errors
        self._slips -= dt_s
        begins = (draws < errors.slip_rate * dt_s) & (np.abs(turns) > _ROLLS_RAD)
        if begins.any():
            for wheel, run in zip(*np.nonzero(begins), strict=True):
                random = self._slip_streams[run]
                self._slips[wheel, run] = random.exponential(errors.slip_duration)
                self._shares[wheel, run] = random.random() * errors.slip_share
        return np.where(self._slips > 0.0, self._shares, 0.0)

    def _advance(self, way: Array, turn: Array) -> None:
        """Move along arcs: exact for constant wheel speeds."""
        half = turn / 2
        # sin(half) / half; below 1e-4 rad its series is exact to the last bit.
        small = np.abs(half) < 1e-4
        chord = way * np.where(
            small, 1.0 - half**2 / 6.0, np.sin(half) / np.where(small, 1.0, half)
        )
        course = self.heading + half
        self.x = self.x + chord * np.cos(course)
        self.y = self.y + chord * np.sin(course)
        self.heading = self.heading + turn
        self.turn_rad = turn


def _approach(value: Array, target: Array, gain: float, loss: float) -> Array:
    """Return `value` brought towards `target`: by `gain` away from zero, by `loss` back to it."""
    target = np.where(value * target < 0.0, 0.0, target)  # first to a stand, then the other way
    step = np.where(np.abs(target) > np.abs(value), gain, loss)
    return np.asarray(np.clip(target, value - step, value + step))
