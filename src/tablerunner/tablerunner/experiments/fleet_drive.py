"""Many simulated drives along one route at once: `experiments.drive.drive_route` over arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError, TablerunnerError
from tablerunner.estimation import LocalizerConfig, Start
from tablerunner.estimation.batch import BatchEkf, BatchEkfCv, BatchFilter, follow, follow_kf
from tablerunner.experiments.drive import ALIGNED_RAD, LONGEST_S, NEAR_M, Route
from tablerunner.geometry.angles import wrap
from tablerunner.odometry import OdometerConfig
from tablerunner.odometry.batch import BatchTrack, dead_reckon
from tablerunner.scenario import Person, Scenario
from tablerunner.simulation.fleet import Fleet, FleetRecord
from tablerunner.uwb import RangerConfig
from tablerunner.uwb.batch import BatchRanges, ranges_of

Array = NDArray[np.float64]

BATCHED = ('kf', 'ekf_cv', 'ekf')
"""Estimators that there are for many robots at once."""


def drive_fleet(
    scenario: Scenario,
    seeds: Sequence[int],
    route: Route,
    speed: float = 0.5,
    still_s: float = 0.0,
    people: Sequence[tuple[Person, ...]] | None = None,
) -> FleetRecord:
    """Return drives from point to point, turning on the spot at each, one for each seed.

    Parameters
    ----------
    scenario, route, speed, still_s
        As for `drive_route`; the route must be clear.
    seeds : sequence of int
    people : sequence of tuple of Person, optional
        Those of each run, when not the scenario's.

    Raises
    ------
    TablerunnerError
        A route was not driven within half an hour.
    """
    fleet = Fleet(scenario, seeds, people)
    base, begin = fleet.base, fleet.now_ns
    points = np.array(route, dtype=float).T  # (2, points)
    target = np.zeros(len(seeds), dtype=np.int64)
    end = np.zeros(len(seeds), dtype=np.int64)
    while True:
        if fleet.now_ns - begin > LONGEST_S * 1e9:
            raise TablerunnerError(f'{scenario.name}: not every run reached the end of its route')
        goal = points[:, np.minimum(target, len(route) - 1)]
        off_x, off_y = goal[0] - base.x, goal[1] - base.y
        ahead = np.hypot(off_x, off_y)
        near = (ahead < NEAR_M) & (target < len(route))
        if near.any():
            target += near
            end[near & (target == len(route))] = fleet.now_ns
            if target.min() == len(route):
                return fleet.record(end)
            continue
        runs = target < len(route)
        moves = runs & (fleet.now_ns - begin >= still_s * 1e9)
        linear, angular = _steer(off_x, off_y, ahead, base.heading, speed)
        fleet.step(linear * moves, angular * moves, runs)


def _steer(
    off_x: Array, off_y: Array, ahead: Array, heading: Array, speed: float
) -> tuple[Array, Array]:
    turn = wrap(np.arctan2(off_y, off_x) - heading)
    aligned = np.abs(turn) <= ALIGNED_RAD
    linear = np.where(aligned, np.minimum(speed, 0.8 * ahead + 0.05), 0.0)
    spin = np.copysign(np.minimum(0.8, 2.0 * np.abs(turn) + 0.1), turn)
    return linear, np.where(aligned, 1.5 * turn, spin)


def reckoned(record: FleetRecord, config: OdometerConfig) -> BatchTrack:
    """Return the odometry of a fleet: `experiments.drive.dead_reckoned` over arrays."""
    return dead_reckon(config, record.stamps, record.wheels, record.imu_stamps, record.yaw_rate)


def ranged(record: FleetRecord, config: RangerConfig) -> BatchRanges:
    """Return the calibrated ranges of a fleet."""
    return ranges_of(config, record.uwb_stamps, record.anchor, record.flight_s, record.gap_db)


def estimated_fleet(
    track: BatchTrack, ranges: BatchRanges, ranger: RangerConfig, config: LocalizerConfig
) -> Iterator[tuple[int, Array]]:
    """Yield the index of each odometry after the first and the believed places, (runs, 2) [m].

    `experiments.belief.estimated` over arrays: on the same samples the same places. What the
    localiser does that a clean drive does not need is left out: being lost, and late data.

    Parameters
    ----------
    track : BatchTrack
    ranges : BatchRanges
    ranger : RangerConfig
        Its anchors are used.
    config : LocalizerConfig
        Its estimator is one of `BATCHED`, its initial pose is given.

    Raises
    ------
    ConfigError
        Another estimator, or no initial pose.
    """
    if config.estimator not in BATCHED:
        raise ConfigError('estimator', config.estimator, 'one of ' + ', '.join(BATCHED))
    if not config.initial_pose:
        raise ConfigError('initial_pose', config.initial_pose, 'x [m], y [m], yaw [rad]')
    covariance = np.diag(np.square(config.initial_pose_std))
    start = Start(int(track.stamps[0]), np.array(config.initial_pose), covariance)
    x, y, z = config.tag_position
    if config.estimator == 'kf':
        yield from follow_kf(
            config.filter, config.positioner, ranger.anchors, (x, y, z), track, ranges, start
        )
        return
    batch: BatchFilter
    if config.estimator == 'ekf':
        batch = BatchEkf(config.filter, ranger.anchors, (x, y, z))
    else:
        batch = BatchEkfCv(config.filter, ranger.anchors, (x, y, z))
    for index, estimate in follow(batch, track, ranges, start):
        yield index, estimate.mean[:, :2]
