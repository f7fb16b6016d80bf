"""One step of Lv's controller against scikit-fuzzy computing the same two rule bases."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from result import Result

from tablerunner.control import VelocityLimits
from tablerunner.control.fuzzy import (
    ReactiveConfig,
    ReactiveController,
    Readings,
    RuleBase,
    load_base,
)
from tablerunner.geometry.pose import Pose2

ROUNDS = 5
STEPS = 2000
REFERENCE_STEPS = 8
COMPARED = 40
ARRAY = 100_000
POINTS = 101  # of a universe, as in scikit-fuzzy's examples
FINE_POINTS = 301  # the corners of all sets are among them
TOLERANCE = 1e-3  # of the output's domain: what a centroid over 301 points is exact to
AGES = (0.12, 0.09, 0.06, 0.03, 0.0)


def rows_of(base: RuleBase, count: int) -> NDArray:
    """Return inputs from all over the domains, shape (count, inputs)."""
    low, high = ([getattr(item, end) for item in base.inputs] for end in ('low', 'high'))
    return np.random.default_rng(1).uniform(low, high, (count, len(base.inputs)))


def best(run: Callable[[], object]) -> float:
    """Return the shortest processor time of several runs [s]: others share the machine."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return min(times)


def ours_us() -> float:
    """Return how long a whole step takes: readings with ages, pose, target to velocity [us]."""
    controller = ReactiveController(ReactiveConfig(), VelocityLimits())
    rng = np.random.default_rng(1)
    cases = [
        (Readings(tuple(distances), AGES), Pose2(x, y, heading), (8.0, 8.0))
        for distances, x, y, heading in zip(
            rng.uniform(0.1, 3.0, (STEPS, 5)).tolist(),
            *rng.uniform(0.5, 9.5, (2, STEPS)).tolist(),
            rng.uniform(-np.pi, np.pi, STEPS).tolist(),
            strict=True,
        )
    ]

    def run() -> None:
        for readings, pose, target in cases:
            controller.step(readings, pose, target)

    return best(run) / STEPS * 1e6


def measure() -> Iterator[Result]:
    """Measure agreement first, then the speed."""
    # Here, so that the other benches run where scikit-fuzzy is not installed.
    from skfuzzy_twin import ByHand, compute, twin

    bases = [load_base(name) for name in ('lv_corner', 'lv_speed')]
    apart = 0.0
    for base in bases:
        centroid = replace(base, defuzzification='centroid')
        reference, rows = twin(base, FINE_POINTS), rows_of(base, COMPARED)
        theirs = np.array([compute(reference, base, row) for row in rows])
        width = base.output.high - base.output.low
        apart = max(apart, float(np.max(np.abs(theirs - centroid.infer(rows)))) / width)
    yield Result(
        'fuzzy difference',
        apart,
        TOLERANCE,
        apart / TOLERANCE,
        '',
        'largest difference from scikit-fuzzy, both by centroid, as a share of the domain; '
        f'reference: {TOLERANCE:g}',
        bound=1.0,
    )
    step = ours_us()
    reference_us = _per_step([twin(base, POINTS) for base in bases], bases, compute)
    yield Result(
        'fuzzy step',
        step,
        reference_us,
        reference_us / step,
        'us',
        'readings, pose and target to a velocity; reference: the two rule bases in scikit-fuzzy',
        bound=50.0,
        at_most=False,
    )
    hands = [ByHand(base, POINTS) for base in bases]
    by_hand_us = _per_step(hands, bases, lambda hand, _base, row: hand.compute(row))
    yield Result(
        'fuzzy step by hand',
        step,
        by_hand_us,
        by_hand_us / step,
        'us',
        'the same; reference: only memberships by scikit-fuzzy, rules in a loop of plain Python',
    )
    corner, many = bases[0], rows_of(bases[0], ARRAY)
    alone_us = best(lambda: [corner.infer_one(*row) for row in many[:STEPS]]) / STEPS * 1e6
    array_us = best(lambda: corner.infer(many)) / ARRAY * 1e6
    yield Result(
        'fuzzy array',
        array_us,
        alone_us,
        alone_us / array_us,
        'us',
        f'lv_corner for {ARRAY} inputs at once, each; reference: ours, one at a time',
    )


def _per_step(
    references: Sequence[Any],
    bases: Sequence[RuleBase],
    one: Callable[[Any, RuleBase, Any], float],
) -> float:
    """Return how long a reference takes for both bases, each time with other inputs [us].

    scikit-fuzzy keeps the results of inputs that it has seen; a robot never comes to the same.
    """
    rows = [iter(rows_of(base, REFERENCE_STEPS * ROUNDS)) for base in bases]

    def run() -> None:
        for reference, base, part in zip(references, bases, rows, strict=True):
            for _ in range(REFERENCE_STEPS):
                one(reference, base, next(part))

    return best(run) / REFERENCE_STEPS * 1e6
