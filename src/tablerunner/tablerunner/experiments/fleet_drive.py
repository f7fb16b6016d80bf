"""Many simulated drives along one route at once: `experiments.drive.drive_route` over arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import TablerunnerError
from tablerunner.experiments.drive import ALIGNED_RAD, LONGEST_S, NEAR_M, Route
from tablerunner.geometry.angles import wrap
from tablerunner.scenario import Person, Scenario
from tablerunner.simulation.fleet import Fleet, FleetRecord

Array = NDArray[np.float64]


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
