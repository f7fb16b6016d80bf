"""Dead reckoning of many robots at once: `Odometer` over arrays.

All runs share their stamps; arrays have time first and runs last. For recorded or simulated data
that is known to be clean: nothing is refused here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.odometry.gyro import GyroConfig
from tablerunner.odometry.motion import MotionNoise
from tablerunner.odometry.odometer import OdometerConfig
from tablerunner.odometry.slip import SlipConfig
from tablerunner.types import NANOSECONDS, nanoseconds

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Motions:
    """Arc lengths [m] and turns [rad] of many robots over dt [s], all of shape (runs,).

    `told_variance` is what odometry itself says of the arc lengths [m^2], as in `Motion`.
    """

    distance_m: Array
    turn_rad: Array
    dt_s: Array
    told_variance: Array

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Whose wheels did not move at all, shape (runs,)."""
        return np.asarray((self.distance_m == 0.0) & (self.turn_rad == 0.0))


def variances(noise: MotionNoise, motions: Motions) -> tuple[Array, Array]:
    """Return `MotionNoise.variances` of every robot, shapes (runs,)."""
    length, turn = np.abs(motions.distance_m), np.abs(motions.turn_rad)
    distance = noise.distance**2 * length
    return (
        np.maximum(distance, np.minimum(motions.told_variance, length**2)),
        noise.heading_per_turn**2 * turn
        + noise.heading_per_distance**2 * length
        + noise.heading_per_time**2 * motions.dt_s,
    )


@dataclass(frozen=True)
class BatchTrack:
    """Odometry of many robots.

    Attributes
    ----------
    stamps : ndarray of int64, shape (k,)
    place : ndarray, shape (k, 2, runs)
        base_link in odom [m], from the origin.
    length : ndarray, shape (k, runs)
        Way since the start [m].
    heading : ndarray, shape (k, runs)
        In odom [rad], not wrapped.
    told_variance : ndarray, shape (k, runs)
        Of `length`, as odometry tells it [m^2].
    """

    stamps: Stamps
    place: Array
    length: Array
    heading: Array
    told_variance: Array

    def motions(self, index: int, begin: Array, end: Array) -> Motions:
        """Return the motions within the step that ends with a stamp.

        Parameters
        ----------
        index : int
            Of the stamp.
        begin, end : ndarray, shape (runs,)
            Of each run, as shares of the step from 0 to 1.
        """
        share = end - begin
        return Motions(
            share * (self.length[index] - self.length[index - 1]),
            share * (self.heading[index] - self.heading[index - 1]),
            share * (float(self.stamps[index] - self.stamps[index - 1]) / NANOSECONDS),
            share * (self.told_variance[index] - self.told_variance[index - 1]),
        )

    def laid_on(self, start: tuple[float, float, float]) -> Array:
        """Return the places in map, shape (k, 2, runs) [m], of robots that all began at a pose."""
        cos, sin = np.cos(start[2]), np.sin(start[2])
        x, y = self.place[:, 0], self.place[:, 1]
        return np.stack([start[0] + cos * x - sin * y, start[1] + sin * x + cos * y], axis=1)


def dead_reckon(
    config: OdometerConfig, stamps: Stamps, wheels: Array, imu_stamps: Stamps, yaw_rate: Array
) -> BatchTrack:
    """Return the odometry of many robots.

    Parameters
    ----------
    config : OdometerConfig
    stamps : ndarray of int64, shape (k,)
        Of the wheels.
    wheels : ndarray, shape (k, 2, runs)
        Angles of left and right wheel [rad].
    imu_stamps : ndarray of int64, shape (i,)
    yaw_rate : ndarray, shape (i, runs)
        [rad/s]. Of an IMU sample and a wheel sample with one stamp, the wheels come first.
    """
    rolled = np.diff(wheels, axis=0) * np.array(config.wheels.radii_m)[:, None]
    distance = 0.5 * (rolled[:, 0] + rolled[:, 1])
    turn = (rolled[:, 1] - rolled[:, 0]) / config.wheels.track
    missing = np.zeros_like(turn)
    if config.heading_source == 'gyro':
        angles = gyro_angles(config.gyro, stamps, imu_stamps, yaw_rate)
        turn, missing = _turns_by_gyro(config, stamps, distance, turn, angles)
    heading = np.concatenate([np.zeros_like(turn[:1]), np.cumsum(turn, axis=0)])
    course = heading[:-1] + 0.5 * turn
    steps = np.stack([distance * np.cos(course), distance * np.sin(course)], axis=1)
    place = np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])
    length = np.concatenate([np.zeros_like(turn[:1]), np.cumsum(distance, axis=0)])
    told = np.maximum(
        config.noise.distance**2 * np.abs(distance), np.minimum(missing, distance**2)
    )
    told = np.cumsum(told, axis=0)
    told = np.concatenate([np.zeros_like(turn[:1]), told])
    return BatchTrack(stamps, place, length, heading, told)


def _turns_by_gyro(
    config: OdometerConfig,
    stamps: Stamps,
    distance: Array,
    turn: Array,
    angles: tuple[Array, NDArray[np.bool_]],
) -> tuple[Array, Array]:
    """Return the turn of every step by the gyroscope where it speaks, and what slips may cost.

    Shapes (k - 1, runs): [rad], and the variance that a slip adds to the distance [m^2].
    """
    (angle, alive), gyro = angles, config.gyro
    stands = (distance == 0.0) & (turn == 0.0)
    turns: Array = turn.copy()
    missing: Array = np.zeros_like(turn)
    runs = turn.shape[1]
    slips = _Slips(config.slip, config.wheels.track, runs)
    bias, learned, still = np.zeros(runs), np.zeros(runs), np.zeros(runs)
    for step in range(len(turn)):
        if not (alive[step] and alive[step + 1]):
            still = np.zeros(runs)
            continue
        dt_s = float(stamps[step + 1] - stamps[step]) / NANOSECONDS
        turned = angle[step + 1] - angle[step]
        drift = turned - bias * dt_s
        slipped = slips.add(turn[step], drift, distance[step], dt_s)
        rests = stands[step] & (np.abs(drift) <= gyro.still_rate * dt_s)
        still = np.where(rests, still + dt_s, 0.0)
        learns = rests & (still > gyro.still_time)
        turns[step] = np.where(learns, turn[step], drift)
        missing[step] = np.where(learns, 0.0, slipped)
        if learns.any():
            longer = np.minimum(learned + dt_s, gyro.bias_time_constant)
            learned = np.where(learns, longer, learned)
            share = np.minimum(1.0, dt_s / np.maximum(learned, 1e-12))
            bias = np.where(learns, bias + (turned / dt_s - bias) * share, bias)
    return turns, missing


class _Slips:
    """`SlipWatch` of many robots."""

    def __init__(self, config: SlipConfig, track_m: float, runs: int) -> None:
        self._config, self._track_m = config, track_m
        self._missing_m, self._since_s = np.zeros(runs), np.full(runs, np.inf)

    def add(self, wheels_rad: Array, gyro_rad: Array, distance_m: Array, dt_s: float) -> Array:
        """Return what a slip adds to the variance of each distance [m^2], shape (runs,)."""
        config = self._config
        apart = np.abs(wheels_rad - gyro_rad)
        usual = config.rate * dt_s + config.per_turn * np.abs(gyro_rad)
        slipping = apart > usual + config.per_speed * np.abs(distance_m)
        new = slipping & (self._since_s > config.pause)
        before = np.where(new, 0.0, self._missing_m)
        self._since_s = np.where(slipping, 0.0, self._since_s + dt_s)
        self._missing_m = before + np.where(slipping, 0.5 * self._track_m * apart, 0.0)
        return np.where(slipping, self._missing_m**2 - before**2, 0.0)


def gyro_angles(
    config: GyroConfig, stamps: Stamps, imu_stamps: Stamps, yaw_rate: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the integral of the yaw rate at each stamp, (k, runs), and where it is fresh, (k,).

    A reading is the mean rate since the one before; beyond the newest it is held.
    """
    timeout = nanoseconds(config.timeout)
    gaps = np.diff(imu_stamps)
    steps = yaw_rate[1:] * (gaps / NANOSECONDS)[:, None]
    steps[gaps > timeout] = 0.0
    summed = np.concatenate([np.zeros_like(yaw_rate[:1]), np.cumsum(steps, axis=0)])
    newest = np.searchsorted(imu_stamps, stamps, side='left') - 1
    known = np.maximum(newest, 0)
    ahead = stamps - imu_stamps[known]
    held = summed[known] + yaw_rate[known] * (ahead / NANOSECONDS)[:, None]
    return np.asarray(held), np.asarray((newest >= 0) & (ahead <= timeout))
