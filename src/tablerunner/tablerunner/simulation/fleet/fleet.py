"""Many robots in rooms alike, stepped together: `Simulator` over arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError
from tablerunner.scenario import Person, Scenario
from tablerunner.simulation.fleet.base import FleetBase
from tablerunner.simulation.fleet.crowd import FleetCrowd
from tablerunner.simulation.fleet.draws import Draws
from tablerunner.simulation.fleet.radio import FleetRadio
from tablerunner.simulation.fleet.record import FleetRecord
from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.streams import stream
from tablerunner.simulation.team import START_NS, STEP_NS
from tablerunner.types import seconds

Array = NDArray[np.float64]

_MARGIN = 1.5  # true wheels and slips never make a robot this much faster than its limit


class Fleet:
    """Wheels, gyroscope, ranging and people of many runs.

    What the single simulator has besides is left out: magnetometer, ultrasonic and camera, and the
    bumper. A fleet is for routes that are clear; `FleetRecord.closest_m` says whether people kept
    off.

    Parameters
    ----------
    scenario : Scenario
    seeds : sequence of int
        One for each run.
    people : sequence of tuple of Person, optional
        Those of each run; the scenario's in all when not given.

    Raises
    ------
    ConfigError
        No seeds, no anchors, or different numbers of people.
    """

    def __init__(
        self,
        scenario: Scenario,
        seeds: Sequence[int],
        people: Sequence[tuple[Person, ...]] | None = None,
    ) -> None:
        if not seeds:
            raise ConfigError('seeds', [], 'at least one')
        if not scenario.anchors:
            raise ConfigError('anchors', [], 'at least one')
        robot, errors = scenario.robot, scenario.sensors
        self._robot, self._errors = robot, errors
        start = scenario.start_pose
        self.now_ns = START_NS
        self.base = FleetBase(robot, errors.wheels, (start.x, start.y, start.heading), seeds)
        speed = _MARGIN * max(robot.limits.speed, robot.limits.reverse_speed)
        crowds = [scenario.people] * len(seeds) if people is None else people
        self.crowd = FleetCrowd(crowds, seeds, speed)
        self.radio = FleetRadio(scenario, seeds)
        self._encoder_start = np.array(
            [stream(seed, 'encoders').random(2) * 2 * math.pi for seed in seeds]
        ).T
        ticks = errors.wheels.ticks_per_turn
        self._tick_rad = 2 * math.pi / ticks if ticks else 0.0
        imu = [stream(seed, 'imu') for seed in seeds]
        first = np.array([random.standard_normal(4) for random in imu]).T
        self._gyro_bias = first[0] * errors.imu.gyro_bias_std
        self._gyro_scale = 1.0 + first[1] * errors.imu.gyro_scale_std
        self._imu_draws = Draws(imu, normals=4)
        self._turned = np.zeros(len(seeds))
        self._imu_ns: int | None = None
        self._wheels_due = Schedule(1.0 / errors.wheels.rate, START_NS)
        self._imu_due = Schedule(1.0 / errors.imu.rate, START_NS)
        self._uwb_due = Schedule(1.0 / (errors.uwb.rate * len(scenario.anchors)), START_NS)
        self._closest_m = np.full(len(seeds), np.inf)
        self._wheels: list[tuple[int, Array, Array]] = []
        self._rates: list[tuple[int, Array]] = []
        self._exchanges: list[tuple[int, int, Array, Array, NDArray[np.bool_]]] = []

    def step(self, linear: Array, angular: Array, runs: NDArray[np.bool_]) -> None:
        """Advance by one step of 10 ms.

        Parameters
        ----------
        linear, angular : ndarray, shape (runs,)
            Commands [m/s], [rad/s].
        runs : ndarray of bool, shape (runs,)
            Which runs still count, for `FleetRecord.closest_m`.
        """
        dt_s = seconds(STEP_NS)
        self.now_ns += STEP_NS
        now, base = self.now_ns, self.base
        base.step(linear, angular, dt_s)
        self._turned = self._turned + base.turn_rad
        self.crowd.step(dt_s, np.stack([base.x, base.y]), self._robot.footprint_radius)
        if self._wheels_due.is_due(now):
            pose = np.stack([base.x, base.y, base.heading])
            self._wheels.append((now, pose, self._read_encoders()))
        if self._imu_due.is_due(now):
            self._rates.append((now, self._read_gyro(now)))
        if self._uwb_due.is_due(now):
            self._range(now, runs)

    def _read_encoders(self) -> Array:
        angle = self._encoder_start + self.base.angle_rad
        if self._tick_rad == 0.0:
            return np.asarray(angle)
        return np.asarray(np.floor(angle / self._tick_rad) * self._tick_rad)

    def _read_gyro(self, stamp: int) -> Array:
        errors = self._errors.imu
        dt_s = 1.0 / errors.rate if self._imu_ns is None else seconds(stamp - self._imu_ns)
        draws, _ = self._imu_draws.row()
        self._gyro_bias = self._gyro_bias + errors.gyro_bias_walk * math.sqrt(dt_s) * draws[0]
        rate = self._gyro_scale * (self._turned / dt_s) + self._gyro_bias
        self._imu_ns, self._turned = stamp, np.zeros_like(self._turned)
        return np.asarray(rate + errors.gyro_std * draws[1])

    def _range(self, now: int, runs: NDArray[np.bool_]) -> None:
        base, places, sizes = self.base, self.crowd.places, self.crowd.sizes
        if places.shape[1]:
            away = np.hypot(places[0] - base.x, places[1] - base.y) - sizes[0]
            free = away.min(axis=0) - self._robot.footprint_radius
            self._closest_m = np.where(runs, np.minimum(self._closest_m, free), self._closest_m)
        seen = self.radio.exchange(
            now, self.radio.tag(base.x, base.y, base.heading), places, sizes
        )
        gap = seen.rx_power_dbm - seen.first_path_power_dbm
        self._exchanges.append((now, seen.anchor, seen.flight_s, gap, seen.blocked))

    def record(self, end: NDArray[np.int64]) -> FleetRecord:
        """Return what was measured.

        Parameters
        ----------
        end : ndarray of int64, shape (runs,)
            When each run ended [ns].
        """
        stamps, truth, wheels = zip(*self._wheels, strict=True)
        imu_stamps, rates = zip(*self._rates, strict=True)
        uwb_stamps, anchor, flights, gaps, blocked = zip(*self._exchanges, strict=True)
        return FleetRecord(
            np.array(stamps, dtype=np.int64),
            np.stack(truth),
            np.stack(wheels),
            np.array(imu_stamps, dtype=np.int64),
            np.stack(rates),
            np.array(uwb_stamps, dtype=np.int64),
            np.array(anchor, dtype=np.int64),
            np.stack(flights),
            np.stack(gaps),
            np.stack(blocked),
            end,
            self._closest_m,
        )
