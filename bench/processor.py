"""Processor time of each node while the whole graph runs in real time."""

from __future__ import annotations

import time
from collections.abc import Iterator

import psutil
from graph import running
from result import Result

SETTLE_S = 8.0
MEASURE_S = 30.0


def measure() -> Iterator[Result]:
    """Drive a round and add up what each process takes of one core."""
    with running(1.0) as nodes:
        time.sleep(SETTLE_S)
        begun = {name: _used(process) for name, process in nodes.items()}
        start = time.monotonic()
        time.sleep(MEASURE_S)
        took = time.monotonic() - start
        shares = {name: (_used(process) - begun[name]) / took for name, process in nodes.items()}
    for name, share in shares.items():
        yield Result(
            f'processor, {name}', share, 1.0, share, 'cores', 'at the rates of the contract'
        )
    whole = sum(shares.values())
    yield Result(
        'processor, all nodes', whole, 1.0, whole, 'cores', 'the graph in real time', bound=1.0
    )


def _used(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)
