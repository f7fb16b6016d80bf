"""The same run for many seeds, on every core."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from tablerunner.experiments.experiment import Progress

S = TypeVar('S')
T = TypeVar('T')


def run_seeds(
    run: Callable[[S], T],
    seeds: Sequence[S],
    progress: Progress = lambda done, count: None,
    workers: int | None = None,
) -> list[T]:
    """Return `run(seed)` of every seed, in the order of the seeds.

    Parameters
    ----------
    run : callable
        A function of a module (it is sent to other processes), pure but for its seed: the result
        does not depend on the number of workers.
    seeds : sequence
        Seeds, or whatever else a run is made of: a tuple of seeds that are run at once.
    progress : callable, optional
        Called after each seed.
    workers : int, optional
        Processes; as many as there are cores when not given. One: no other process is made.
    """
    count = min(workers or os.cpu_count() or 1, len(seeds))
    results: list[T] = []
    if count <= 1:
        for seed in seeds:
            results.append(run(seed))
            progress(len(results), len(seeds))
        return results
    with ProcessPoolExecutor(count) as pool:
        for result in pool.map(run, seeds):
            results.append(result)
            progress(len(results), len(seeds))
    return results
