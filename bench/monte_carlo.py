"""Many robots as arrays: a step of the EKF against the single one, and 1000 seeds of sun2019."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator

import numpy as np
from filter_step import ANCHORS, CONFIG, LEVER, MOTION, SAMPLES, START, VARIANCE, Ours
from result import Result

from tablerunner.cli.bar import Bar
from tablerunner.estimation.batch import BatchEkf, BatchEstimate
from tablerunner.experiments.sun2019 import run_sun2019
from tablerunner.odometry.batch import Motions

RUNS = 1000
STEPS = 100
SINGLE_STEPS = 1000  # of `filter_step.Ours`
ROUNDS = 5
SEEDS = 1000
LONGEST_S = 60.0
CORES = 2


def batched() -> BatchEstimate:
    """Run as many filters as there are runs, each on the same ranges as the single one."""
    ekf = BatchEkf(CONFIG, ANCHORS, LEVER)
    estimate = ekf.start(START, RUNS)
    motions = Motions(
        *(
            np.full(RUNS, value)
            for value in (MOTION.distance_m, MOTION.turn_rad, MOTION.dt_s, MOTION.told_variance)
        )
    )
    unknown = np.full(RUNS, math.nan)
    ranges = [np.full(RUNS, sample.range_m) for sample in SAMPLES]
    for k in range(STEPS):
        estimate = ekf.predict(estimate, motions)
        estimate, _ = ekf.update_range(estimate, k % 4, ranges[k % 4], VARIANCE, unknown)
    return estimate


def measure() -> Iterator[Result]:
    """Measure a step of one filter, alone and among many; then the whole experiment."""
    times = [
        (_seconds(lambda: Ours(1).run(SINGLE_STEPS)), _seconds(batched)) for _ in range(ROUNDS)
    ]
    alone, many = np.min(times, axis=0) * 1e6
    single, step = float(alone) / SINGLE_STEPS, float(many) / (STEPS * RUNS)
    yield Result(
        'batched ekf step',
        step,
        single,
        single / step,
        'us',
        f'predict and one range of one filter, {RUNS} at a time; reference: one at a time',
        bound=20.0,
        at_most=False,
    )
    begun, before = time.perf_counter(), _processor_s()
    with Bar('1000 seeds of sun2019') as bar:
        outcome = run_sun2019(range(SEEDS), bar.show)
    clock = time.perf_counter() - begun
    took = (_processor_s() - before) / CORES
    missed = ', '.join(row.name for row in outcome.rows if not row.holds) or 'nothing'
    yield Result(
        'sun2019, 1000 seeds',
        took,
        LONGEST_S,
        took / LONGEST_S,
        's',
        f'processor time over {CORES} cores, both situations, sensors and three filters; '
        f'{clock:.0f} s by the clock beside whatever else ran; out of bound: {missed}',
        bound=1.0,
    )


def _processor_s() -> float:
    """Return the processor time of this process and of those that it has waited for [s]."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def _seconds(run: Callable[[], object]) -> float:
    begun = time.process_time()
    run()
    return time.process_time() - begun
