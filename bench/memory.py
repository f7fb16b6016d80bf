"""Memory of each node over ten simulated minutes of driving."""

from __future__ import annotations

import time
from collections.abc import Iterator

from graph import running
from result import Result

FACTOR = 2.0
MINUTES = 10.0
SETTLED = 2.0  # minutes after which buffers and caches have their size
STOPS = 4 * tuple(f'table_{k}' for k in (1, 3, 9, 4, 6, 2, 11, 10, 7, 5, 8))  # more than enough


def measure() -> Iterator[Result]:
    """Compare the memory after two and after ten simulated minutes."""
    with running(FACTOR, STOPS) as nodes:
        time.sleep(SETTLED * 60.0 / FACTOR)
        early = {name: process.memory_info().rss / 2**20 for name, process in nodes.items()}
        time.sleep((MINUTES - SETTLED) * 60.0 / FACTOR)
        late = {name: process.memory_info().rss / 2**20 for name, process in nodes.items()}
    for name in nodes:
        yield Result(
            f'memory, {name}',
            late[name],
            early[name],
            late[name] / early[name],
            'MiB',
            f'after {MINUTES:g} simulated minutes of driving against after {SETTLED:g}',
            bound=1.05,
        )
