"""PF-UIEKF on the benchmark of its paper, and where damping decides.

Every seed is one run of 60 steps, as each of the paper's hundred: the truth and its measurements
come from one stream, the particles from another. So all filters see the same data and the same
random numbers, and what differs are they.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tablerunner.estimation.particles.growth_model import (
    RATE,
    SHAPE,
    SWITCH,
    GrowthModel,
    SaturatingModel,
)
from tablerunner.estimation.particles.particle_filter import PROPOSALS, ParticleFilter
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.types import Matrix, Vector

STEPS = 60
COUNTS = (20, 50, 200)
"""Particles, as in the paper's tables 1 to 3."""
FILTERS = tuple(PROPOSALS)
START, START_VARIANCE = 1.0, SHAPE / RATE**2
PAPER_TIME_MS = 1661.3
"""All that is left of the paper's figures: PF-UIEKF with 50 particles, on their machine."""

_COLOURS = dict(zip(FILTERS, ('#E69F00', '#0072B2', '#CC79A7', '#009E73'), strict=True))


@dataclass(frozen=True)
class FilterRun:
    """One filter on one run.

    Attributes
    ----------
    means : ndarray, shape (steps,)
        Mean of the particles at each step.
    rmse : float
    seconds : float
        Of processor time.
    worse : float
        Share of all searches that ended worse than they began.
    """

    means: Vector
    rmse: float
    seconds: float
    worse: float


@dataclass(frozen=True)
class Drawn:
    """One run: the truth and what every filter made of it.

    Attributes
    ----------
    truth : ndarray, shape (steps,)
    runs : mapping of (filter, particles) to FilterRun
    """

    truth: Vector
    runs: dict[tuple[str, int], FilterRun]


def run_pf_uiekf(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run both cases for many seeds."""
    both = run_seeds(one_run, seeds, progress)
    benchmark = [pair[0] for pair in both]
    harder = [pair[1] for pair in both]
    return Outcome(
        'pf_uiekf',
        'PF-UIEKF: the benchmark (tables 1 to 3), and a sensor that saturates',
        tuple(seeds),
        (*_benchmark_rows(benchmark), *_order_rows(benchmark), *_harder_rows(harder)),
        partial(draw, benchmark=benchmark, harder=harder),
        {
            'steps': STEPS,
            'variance of the measurement noise': float(GrowthModel().noise[0, 0]),
            'the same of the sensor that saturates': float(SaturatingModel().noise[0, 0]),
            'its steepness': SaturatingModel().steepness,
            'start': START,
            'variance of the start': START_VARIANCE,
            'resampling': 'multinomial, below half effective',
        },
        (
            ("The tables' figures are lost; the model and what is said of their order are not."),
            (
                'Where PF-IEKF converges in every step, damping has nothing to do: PF-UIEKF '
                'begins undamped and takes the same steps.'
            ),
            (
                'Worse: the share of the searches whose cost is higher at the end than at the '
                'start. A damped search never does that.'
            ),
            'Time is processor time of one run; all particles are one array.',
        ),
    )


def one_run(seed: int, counts: Sequence[int] = COUNTS) -> tuple[Drawn, Drawn]:
    """Return the benchmark and the harder case of one seed."""
    return drawn(GrowthModel(), seed, counts), drawn(SaturatingModel(), seed, counts[:1])


def drawn(model: GrowthModel, seed: int, counts: Sequence[int]) -> Drawn:
    """Return a run of one model with every filter and number of particles."""
    truth, measured = simulate(model, np.random.default_rng([seed, 0]))
    runs = {
        (name, count): follow(model, name, count, truth, measured, seed)
        for count in counts
        for name in FILTERS
    }
    return Drawn(truth[:, 0], runs)


def simulate(model: GrowthModel, rng: np.random.Generator) -> tuple[Matrix, Matrix]:
    """Return the states and the measurements of a run, both of shape (steps, 1)."""
    state, states, measured = np.array([START]), [], []
    for step in range(1, STEPS + 1):
        state = model.draw(state[None], step, rng)[0]
        states.append(state)
        measured.append(model.measure(state, step, rng))
    return np.array(states), np.array(measured)


def follow(
    model: GrowthModel, name: str, count: int, truth: Matrix, measured: Matrix, seed: int
) -> FilterRun:
    """Return what a filter makes of the measurements of a run."""
    rng = np.random.default_rng([seed, 1])
    filter_ = ParticleFilter(model, name)
    begun = time.process_time()
    states = START + math.sqrt(START_VARIANCE) * rng.standard_normal((count, 1))
    cloud = filter_.start(states, np.array([[START_VARIANCE]]))
    means, worse = [], []
    for step in range(1, STEPS + 1):
        cloud, told = filter_.step(cloud, measured[step - 1], step, rng)
        means.append(told.mean[0])
        worse.append(told.worse)
    seconds = time.process_time() - begun
    found = np.array(means)
    rmse = float(np.sqrt(np.mean((found - truth[:, 0]) ** 2)))
    return FilterRun(found, rmse, seconds, float(np.mean(worse)))


def label(name: str) -> str:
    """Return the name of a filter as the paper writes it."""
    return name.upper().replace('_', '-')


def _rmse(runs: Sequence[Drawn], name: str, count: int) -> Vector:
    return np.array([run.runs[name, count].rmse for run in runs])


def _benchmark_rows(runs: Sequence[Drawn]) -> tuple[Row, ...]:
    rows = []
    for count in COUNTS:
        for name in FILTERS:
            head = f'{label(name)}, N = {count}'
            errors = _rmse(runs, name, count)
            times = [1e3 * run.runs[name, count].seconds for run in runs]
            variance = float(errors.var(ddof=1)) if len(errors) > 1 else 0.0
            paper = PAPER_TIME_MS if (name, count) == ('pf_uiekf', 50) else None
            rows += [
                Row(f'{head}, RMSE', '1', Spread.of(errors)),
                Row(f'{head}, variance of RMSE', '1', Spread.of([variance])),
                Row(f'{head}, time', 'ms', Spread.of(times), paper),
            ]
    return tuple(rows)


def _order_rows(runs: Sequence[Drawn]) -> tuple[Row, ...]:
    """Return the published order as ratios of mean RMSE, and what more particles cost."""
    few, many = COUNTS[0], COUNTS[-1]
    mean = {(name, count): _rmse(runs, name, count).mean() for name in FILTERS for count in COUNTS}

    def ratio(name: str, other: str, count: int, bound: Bound) -> Row:
        title = f'{label(name)} to {label(other)}, N = {count}, ratio of mean RMSE'
        return Row(title, '1', Spread.of([mean[name, count] / mean[other, count]]), bound=bound)

    times = [
        run.runs['pf_uiekf', many].seconds / run.runs['pf_uiekf', few].seconds for run in runs
    ]
    return (
        ratio('pf', 'pf_ekf', few, Bound(low=1.0)),
        ratio('pf_ekf', 'pf_iekf', few, Bound(low=1.0)),
        # Equal where every search converges, but for the last digits of where each stopped.
        ratio('pf_uiekf', 'pf_iekf', few, Bound(high=1.001)),
        ratio('pf_uiekf', 'pf_iekf', COUNTS[1], Bound(high=1.001)),
        ratio('pf_iekf', 'pf_uiekf', many, Bound(0.999, 1.05)),
        Row(f'PF-UIEKF, N = {many} to N = {few}, ratio of time', '1', Spread.of(times)),
    )


def _harder_rows(runs: Sequence[Drawn]) -> tuple[Row, ...]:
    count = COUNTS[0]
    rows = []
    for name in FILTERS:
        head = f'saturating, {label(name)}, N = {count}'
        bound = None
        if name == 'pf_uiekf':
            bound = Bound(high=0.5 * float(_rmse(runs, 'pf_iekf', count).mean()))
        rows.append(Row(f'{head}, RMSE', '1', Spread.of(_rmse(runs, name, count)), bound=bound))
        if name in ('pf_iekf', 'pf_uiekf'):
            worse = [100.0 * run.runs[name, count].worse for run in runs]
            asked = Bound(high=0.0) if name == 'pf_uiekf' else Bound(low=1.0)
            rows.append(Row(f'{head}, worse', '%', Spread.of(worse), bound=asked))
    return tuple(rows)


def draw(figure: Any, benchmark: Sequence[Drawn], harder: Sequence[Drawn]) -> None:
    """Draw figure 6 (means of the first run), the errors over N, and the harder case."""
    figure.set_size_inches(9.0, 10.0)
    upper, middle, lower = figure.subplots(3, 1, height_ratios=(3.0, 2.5, 2.5))
    _draw_means(upper, benchmark[0], COUNTS[0], 'PF-UIEKF, figure 6: means of the particles')
    upper.axvline(SWITCH + 0.5, color='0.8', linewidth=1.0, zorder=0)
    for name in FILTERS:
        errors = [_rmse(benchmark, name, count) for count in COUNTS]
        middle.errorbar(
            np.array(COUNTS) * (0.97 + 0.02 * FILTERS.index(name)),
            [values.mean() for values in errors],
            yerr=np.abs(
                np.array([np.percentile(values, (5.0, 95.0)) for values in errors]).T
                - np.array([values.mean() for values in errors])
            ),
            label=label(name),
            color=_COLOURS[name],
            marker='o',
            markersize=4.0,
            capsize=2.0,
        )
    middle.set_xscale('log')
    middle.set_yscale('log')
    middle.set_xticks(COUNTS, [str(count) for count in COUNTS])
    middle.minorticks_off()
    middle.set_xlabel('particles')
    middle.set_ylabel('RMSE, mean and 5-95 %')
    middle.legend(ncols=4)
    _draw_means(lower, harder[0], COUNTS[0], 'a sensor that saturates')
    truth = harder[0].truth
    lower.set_ylim(truth.min() - 2.0, truth.max() + 2.0)


def _draw_means(axes: Any, run: Drawn, count: int, title: str) -> None:
    steps = np.arange(1, STEPS + 1)
    axes.plot(steps, run.truth, color='black', linewidth=2.5, alpha=0.35, label='truth')
    for name in FILTERS:
        means = run.runs[name, count].means
        axes.plot(steps, means, color=_COLOURS[name], linewidth=1.0, label=label(name))
    axes.set_title(f'{title}, N = {count}', loc='left')
    axes.set_xlabel('step')
    axes.set_ylabel('state')
    axes.legend(ncols=5)
