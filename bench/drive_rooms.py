"""Rooms of the drive test per minute on two cores, against driving them in real time."""

from __future__ import annotations

import time
from collections.abc import Iterator

from result import Result

from tablerunner.experiments.drive_room import drive_room
from tablerunner.experiments.random_room import make_drive_room

SEEDS = range(6, 12)
CORES = 2
LEAST = 5.0


def measure() -> Iterator[Result]:
    """Make some rooms and drive them, one after the other, in processor time."""
    begun, driven = time.process_time(), 0.0
    for seed in SEEDS:
        driven += drive_room(make_drive_room(seed), 'fuzzy').time_s
    took = time.process_time() - begun
    ours, real = (60.0 * CORES * len(SEEDS) / seconds for seconds in (took, driven))
    yield Result(
        'drive-test rooms',
        ours,
        real,
        ours / real,
        '1/min',
        f'made and driven on {CORES} cores, by processor time; reference: in real time',
        bound=LEAST,
        at_most=False,
    )
