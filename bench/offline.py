"""Offline replay of a bag at the contract's rates, in multiples of real time."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from recording import RESTAURANT, record
from result import Result

from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import replay
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.scenario import load_scenario

SECONDS = 120.0
ROUNDS = 3


def measure() -> Iterator[Result]:
    """Record two simulated minutes without DDS, replay them from the raw topics."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        record(path, SECONDS)
        took = math.inf
        for _ in range(ROUNDS):
            begun = time.perf_counter()
            result = replay(BagReader(path), ReplayConfig.from_scenario(load_scenario(RESTAURANT)))
            took = min(took, time.perf_counter() - begun)
        if not result.estimates.settled().stamps.size:
            raise RuntimeError('the replay found no start')
    yield Result(
        'offline replay',
        SECONDS / took,
        1.0,
        SECONDS / took,
        's of data / s',
        'from joint_states 50 Hz, imu 100 Hz, exchanges 4 x 10 Hz; reading the bag included',
        bound=100.0,
        at_most=False,
    )
