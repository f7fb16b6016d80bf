"""The drive test: tours through many random rooms, and what is asked of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tablerunner.control import CONTROLLERS
from tablerunner.errors import ConfigError
from tablerunner.experiments.drive_room import Leg, RoomDrive, drive_room
from tablerunner.experiments.experiment import Bound, Progress, Row, Spread
from tablerunner.experiments.random_room import make_drive_room
from tablerunner.experiments.seeds import run_seeds

REFERENCE = 'pure_pursuit'
ARRIVE = Bound(low=99.0)
NONE = Bound(high=0.0)
ALL = Bound(low=100.0)


@dataclass(frozen=True)
class DriveTest:
    """All tours.

    Attributes
    ----------
    drives : tuple of RoomDrive
    """

    drives: tuple[RoomDrive, ...]

    @property
    def controllers(self) -> tuple[str, ...]:
        """Who drove, in the order of `CONTROLLERS`."""
        return tuple(
            name for name in CONTROLLERS if any(d.controller == name for d in self.drives)
        )

    @property
    def failed(self) -> tuple[RoomDrive, ...]:
        """Tours in which something went wrong."""
        return tuple(drive for drive in self.drives if drive.faults)

    def rows(self) -> tuple[Row, ...]:
        """Return the table: of each controller what is asked, then what it took."""
        rows: list[Row] = []
        for name in self.controllers:
            drives = [drive for drive in self.drives if drive.controller == name]
            rows += _asked(name, drives)
            rows += _measured(name, drives)
            if name != REFERENCE and REFERENCE in self.controllers:
                rows += self._compared(name)
        return tuple(rows)

    @property
    def holds(self) -> bool:
        """Whether all that is asked is kept."""
        return all(row.holds for row in self.rows())

    def _compared(self, name: str) -> list[Row]:
        """Return time and way against the reference, over legs that both drove from stop to stop.

        The rooms, the people's characters and the errors are the same; where people are is not
        once the two drive differently.
        """
        reference = {
            (drive.seed, leg.stop): leg
            for drive in self.drives
            if drive.controller == REFERENCE
            for leg in drive.legs
            if _is_whole(leg)
        }
        pairs = [
            (leg, reference[drive.seed, leg.stop])
            for drive in self.drives
            if drive.controller == name
            for leg in drive.legs
            if _is_whole(leg) and (drive.seed, leg.stop) in reference
        ]
        if not pairs:
            return []
        times = [ours.time_s / theirs.time_s for ours, theirs in pairs]
        ways = [ours.way_m / theirs.way_m for ours, theirs in pairs]
        return [
            Row(f'{name}, time over {REFERENCE}', '1', Spread.of(times)),
            Row(f'{name}, way over {REFERENCE}', '1', Spread.of(ways)),
        ]

    def as_json(self) -> dict[str, Any]:
        """Return everything as what JSON knows."""
        return {
            'rooms': sorted({drive.seed for drive in self.drives}),
            'holds': self.holds,
            'rows': [
                {
                    'name': row.name,
                    'unit': row.unit,
                    'mean': row.measured.mean,
                    'std': row.measured.std,
                    'median': row.measured.median,
                    'p5': row.measured.p5,
                    'p95': row.measured.p95,
                    'min': row.measured.low,
                    'max': row.measured.high,
                    'count': row.measured.count,
                    'bound': None if row.bound is None else str(row.bound),
                    'holds': row.holds,
                }
                for row in self.rows()
            ],
            'drives': [drive.as_json() for drive in self.drives],
        }


def run_drive_test(
    seeds: Sequence[int],
    controllers: Sequence[str],
    progress: Progress = lambda done, count: None,
    workers: int | None = None,
) -> DriveTest:
    """Drive the tours of many rooms.

    Raises
    ------
    ConfigError
        A controller is not known.
    """
    for name in controllers:
        if name not in CONTROLLERS:
            words = ', '.join((*CONTROLLERS, 'all'))
            raise ConfigError('--controller', name, f'one of {words}')
    tasks = [(seed, name) for seed in seeds for name in controllers]
    return DriveTest(tuple(run_seeds(drive_seed, tasks, progress, workers)))


def drive_seed(task: tuple[int, str]) -> RoomDrive:
    """Make the room of a seed and drive its tour with a controller."""
    seed, controller = task
    return drive_room(make_drive_room(seed), controller)


def _is_whole(leg: Leg) -> bool:
    """Return whether a leg was driven from the stop before to its own."""
    return leg.reached and leg.is_right and math.isfinite(leg.shortest_m)


def _asked(name: str, drives: Sequence[RoomDrive]) -> list[Row]:
    """Return the rows that have bounds."""
    legs = [leg for drive in drives for leg in drive.legs]
    tables = [leg for drive in drives for leg in drive.legs[:-1]]  # the last way is the one home
    rows = [
        Row(
            f'{name}, collisions by the robot',
            '1/room',
            Spread.of([len(drive.collisions) for drive in drives]),
            bound=NONE,
        ),
        Row(
            f'{name}, endless tours',
            '%',
            Spread.of([0.0 if drive.ended else 100.0 for drive in drives]),
            bound=NONE,
        ),
    ]
    for words, of, is_open, bound in (
        ('deliveries that arrive where they can', tables, True, ARRIVE),
        ('stops reached that can be', legs, True, None),
        ('stops reported that cannot be', legs, False, ALL),
    ):
        shares = [100.0 * leg.is_right for leg in of if leg.is_open is is_open]
        if shares:
            rows.append(Row(f'{name}, {words}', '%', Spread.of(shares), bound=bound))
    return rows


def _measured(name: str, drives: Sequence[RoomDrive]) -> list[Row]:
    whole = [leg for drive in drives for leg in drive.legs if _is_whole(leg)]
    figures = {
        ('touches by people', '1/room'): [
            float(len(drive.contacts) - len(drive.collisions)) for drive in drives
        ],
        ('time of a way', 's'): [leg.time_s for leg in whole],
        ('way over the shortest', '1'): [leg.way_m / leg.shortest_m for leg in whole],
        ('pose off, RMSE', 'm'): [drive.rmse_m for drive in drives],
        ('pose off, largest', 'm'): [drive.worst_m for drive in drives],
        ('heading off, RMSE', '°'): [math.degrees(drive.heading_rmse_rad) for drive in drives],
    }
    rows = []
    for (words, unit), values in figures.items():
        known = [value for value in values if math.isfinite(value)]
        if known:
            rows.append(Row(f'{name}, {words}', unit, Spread.of(known)))
    return rows
