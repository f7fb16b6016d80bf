"""UWB fixes against what a user would write: scipy.optimize.least_squares for each epoch."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from result import Result
from scipy.optimize import least_squares

from tablerunner.cli.bar import Bar
from tablerunner.uwb import solve, solve_positions

ROUNDS = 3
REFERENCE_EPOCHS = 300
ARRAY_EPOCHS = 100_000
SINGLE_EPOCHS = 1000
MANY_EPOCHS = 1_000_000
STD, HEIGHT = 0.1, 1.1
ANCHORS = np.array([[0, 0, 2.25], [15, 0, 2.25], [15, 15, 2.25], [0, 15, 2.25]])
Array = NDArray[np.float64]


def ranges_of(count: int) -> Array:
    """Return noisy ranges to places all over a room."""
    rng = np.random.default_rng(1)
    place = np.column_stack([rng.uniform(0.5, 14.5, (count, 2)), np.full(count, HEIGHT)])
    distance = np.linalg.norm(place[:, None] - ANCHORS, axis=2)
    return distance + rng.normal(0, STD, distance.shape)


def reference(ranges: Array, tolerance: float = 1e-8) -> Array:
    """Return the positions by a loop over scipy's solver, at its default tolerance."""

    def residuals(place: Array, row: Array) -> Array:
        plane = np.sum((place - ANCHORS[:, :2]) ** 2, axis=1)
        return (np.sqrt(plane + (ANCHORS[:, 2] - HEIGHT) ** 2) - row) / STD

    start = ANCHORS[:, :2].mean(axis=0)
    ends = {'xtol': tolerance, 'ftol': tolerance, 'gtol': tolerance}
    return np.array([least_squares(residuals, start, args=(row,), **ends).x for row in ranges])


def best(run: Callable[[], object]) -> float:
    """Return the shortest processor time of several runs [s]: others share the machine."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return min(times)


def measure() -> Iterator[Result]:
    """Measure accuracy first, then arrays, single epochs and a million of them."""
    few, many = ranges_of(REFERENCE_EPOCHS), ranges_of(ARRAY_EPOCHS)
    ours = solve('nonlinear', ANCHORS, few, STD, HEIGHT).position
    apart = float(np.max(np.abs(ours - reference(few, 1e-12))))
    yield Result(
        'solver difference',
        apart,
        1e-6,
        apart / 1e-6,
        'm',
        'largest difference of positions from scipy.optimize.least_squares; reference: 1e-6 m',
        bound=1.0,
    )
    loop = best(lambda: reference(few)) / REFERENCE_EPOCHS * 1e6
    array = best(lambda: solve('nonlinear', ANCHORS, many, STD, HEIGHT)) / ARRAY_EPOCHS * 1e6
    yield Result(
        'solver array',
        array,
        loop,
        loop / array,
        'us',
        f'an epoch of 4 ranges, {ARRAY_EPOCHS} at a time; reference: scipy in a loop',
        bound=50.0,
        at_most=False,
    )
    single = (
        best(lambda: [solve_positions(ANCHORS, row, STD, HEIGHT) for row in many[:SINGLE_EPOCHS]])
        / SINGLE_EPOCHS
        * 1e6
    )
    yield Result(
        'solver single',
        single,
        loop,
        loop / single,
        'us',
        'one epoch at a time; reference: scipy in a loop',
        bound=5.0,
        at_most=False,
    )
    yield from _million()


def _million() -> Iterator[Result]:
    ranges = ranges_of(MANY_EPOCHS)
    begun = time.perf_counter()
    with Bar('a million epochs') as bar:
        solve('nonlinear', ANCHORS, ranges, STD, HEIGHT, progress=bar.show)
    took = time.perf_counter() - begun
    tracemalloc.start()
    fix = solve('nonlinear', ANCHORS, ranges, STD, HEIGHT)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    if not fix.solved.all():
        raise RuntimeError('some epochs were not solved')
    size = float(ranges.nbytes)
    yield Result(
        'solver million',
        peak / 1e6,
        size / 1e6,
        peak / size,
        'MB',
        f'peak memory beyond 1 000 000 x 4 ranges, in {took:.1f} s; reference: the ranges',
        bound=10.0,
    )
