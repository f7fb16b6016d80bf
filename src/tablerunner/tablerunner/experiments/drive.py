"""A simulated drive along a route: what the sensors said, and the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import TablerunnerError
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import Scenario
from tablerunner.simulation import Simulator
from tablerunner.simulation.sample import Sample
from tablerunner.simulation.truth import Truth
from tablerunner.types import (
    ExchangeSample,
    ImuSample,
    OdometrySample,
    PoseSample,
    RangeSample,
    Velocity,
    WheelSample,
)
from tablerunner.uwb import Positioner, PositionerConfig, Ranger, RangerConfig

Array = NDArray[np.float64]
Route = tuple[tuple[float, float], ...]

NEAR_M = 0.05
ALIGNED_RAD = 0.15
LONGEST_S = 1800.0


@dataclass(frozen=True)
class Drive:
    """One drive.

    Attributes
    ----------
    samples : tuple
        What was measured, in order.
    stamps : ndarray of int64, shape (k,)
        Of the truth [ns].
    poses : ndarray, shape (k, 3)
        True x, y [m], heading [rad].
    """

    samples: tuple[Sample, ...]
    stamps: NDArray[np.int64]
    poses: Array

    def place_at(self, stamps: NDArray[np.int64]) -> Array:
        """Return the true positions at times, shape (m, 2) [m]."""
        return np.column_stack(
            [np.interp(stamps, self.stamps, self.poses[:, axis]) for axis in range(2)]
        )


def drive_route(
    scenario: Scenario, seed: int, route: Route, speed: float = 0.5, still_s: float = 0.0
) -> Drive:
    """Return a drive from point to point, turning on the spot at each.

    The driver sees the truth: what is compared are estimates on the same drive.

    Parameters
    ----------
    scenario : Scenario
    seed : int
    route : tuple of (x, y)
        Points after the start [m].
    speed : float
        [m/s].
    still_s : float
        Time to stand at the start [s].

    Raises
    ------
    TablerunnerError
        The route was not driven within half an hour: something is in the way.
    """
    simulator = Simulator(scenario, seed)
    samples: list[Sample] = []
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    begin = simulator.now_ns
    target = 0
    while target < len(route):
        pose = simulator.truth.pose
        if simulator.now_ns - begin > LONGEST_S * 1e9:
            raise TablerunnerError(f'{scenario.name}: point {target} of the route was not reached')
        if math.dist((pose.x, pose.y), route[target]) < NEAR_M:
            target += 1
            continue
        waiting = simulator.now_ns - begin < still_s * 1e9
        command = Velocity(0.0, 0.0) if waiting else _steer(pose, route[target], speed)
        for sample in simulator.step(command):
            samples.append(sample)
            if isinstance(sample, Truth):
                stamps.append(sample.stamp)
                poses.append((sample.pose.x, sample.pose.y, sample.pose.heading))
    return Drive(tuple(samples), np.array(stamps, dtype=np.int64), np.array(poses))


def uwb_fixes(
    drive: Drive, ranger: RangerConfig, positioner: PositionerConfig
) -> tuple[NDArray[np.int64], Array]:
    """Return the stamps, (m,), and places, (m, 2), of all UWB-only fixes of a drive."""
    ranging, positioning = Ranger(ranger), Positioner(positioner, ranger.anchors)
    stamps, places = [], []
    for sample in drive.samples:
        if not isinstance(sample, ExchangeSample):
            continue
        ranged = ranging.add(sample)
        fix = positioning.add(ranged) if isinstance(ranged, RangeSample) else None
        if isinstance(fix, PoseSample):
            stamps.append(fix.stamp)
            places.append((fix.pose.x, fix.pose.y))
    return np.array(stamps, dtype=np.int64), np.array(places).reshape(-1, 2)


def dead_reckoned(drive: Drive, config: OdometerConfig) -> tuple[NDArray[np.int64], Array]:
    """Return stamps, (m,), and places, (m, 2), of odometry laid on the true start."""
    odometer = Odometer(config)
    stamps, poses = [], []
    for sample in drive.samples:
        if isinstance(sample, ImuSample):
            odometer.add_imu(sample)
        elif isinstance(sample, WheelSample):
            moved = odometer.add_wheels(sample)
            if isinstance(moved, OdometrySample):
                stamps.append(moved.stamp)
                poses.append(moved.pose)
    start = Pose2(*drive.poses[0]) @ poses[0].inverse()
    laid = [start @ pose for pose in poses]
    return np.array(stamps, dtype=np.int64), np.array([(pose.x, pose.y) for pose in laid])


def errors_of(drive: Drive, stamps: NDArray[np.int64], places: Array) -> Array:
    """Return the distances of places from the truth at their times, shape (m,) [m]."""
    return np.asarray(np.linalg.norm(places - drive.place_at(stamps), axis=1))


def _steer(pose: Pose2, goal: tuple[float, float], speed: float) -> Velocity:
    ahead = math.dist((pose.x, pose.y), goal)
    turn = wrap(math.atan2(goal[1] - pose.y, goal[0] - pose.x) - pose.heading)
    if abs(turn) > ALIGNED_RAD:
        return Velocity(0.0, math.copysign(min(0.8, 2.0 * abs(turn) + 0.1), turn))
    return Velocity(min(speed, 0.8 * ahead + 0.05), 1.5 * turn)
