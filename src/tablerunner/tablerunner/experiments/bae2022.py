"""Bae et al. 2022: a tag about a robot that carries four anchors (tables 2 to 6).

The tag goes once round the robot on a square and on a circle; every range has the bias of its
anchor and normal noise. Beside the paper's six methods stands ours, which filters the ranges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.target_tracker import TargetTracker, TargetTrackerConfig
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.solvers.component_wise import ComponentCorrector, calibrate_bias
from tablerunner.uwb.solvers.registry import solve

Array = NDArray[np.float64]

ANCHOR_HEIGHT_M = 0.594
ANCHORS = np.array(
    [
        [0.251, 0.255, ANCHOR_HEIGHT_M],
        [-0.251, 0.255, ANCHOR_HEIGHT_M],
        [-0.251, -0.255, ANCHOR_HEIGHT_M],
        [0.251, -0.255, ANCHOR_HEIGHT_M],
    ]
)
"""On the upper corners of the robot, in its frame [m]."""

BIASES_M = np.array([-0.010, -0.180, 0.056, -0.029])
NOISE_M = 0.050
"""Table 1: mean and deviation of the range error of each anchor."""

SAMPLES = 2000
SPEED_M_S = 0.1
TABLE6_TAG_HEIGHT_M = 1.0
TABLE6_DISTANCES_M = (1.0, 3.0, 5.0, 7.0)
TABLE6_SAMPLES = 400

METHODS = ('M-HB', 'LS (T)', 'RWLS', 'T_C', 'T_R', 'T_F')
PAPER_MM = {
    'square': (801.8, 703.3, 623.9, 360.2, 239.5, 162.2),
    'circle': (686.1, 610.2, 547.6, 314.8, 212.8, 143.3),
}
"""Tables 2 to 5: mean error of each of `METHODS`."""

PAPER_TABLE6_MM = {
    'M-HB': (274.8, 610.0, 976.1, 1303.6),
    'LS (T)': (242.7, 592.3, 863.3, 1271.6),
    'RWLS': (219.6, 560.1, 676.0, 1132.1),
    'T_F': (96.6, 282.3, 487.9, 601.3),
}
OURS_MM = {'square': 90.0, 'circle': 80.0}
OURS = 'ours: tracker'

_CALIBRATION = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_CALIBRATION_SAMPLES = 300  # of each point
_CALIBRATED_AT = np.repeat(_CALIBRATION, _CALIBRATION_SAMPLES, axis=0)
_TRACKER = TargetTrackerConfig(acceleration=0.1, range_std=NOISE_M, speed_std=0.5)


@dataclass(frozen=True)
class BaeRun:
    """One seed.

    Attributes
    ----------
    errors : dict of str to dict of str to float
        Path, method, mean error [mm].
    table6 : dict of str to ndarray, shape (distances,)
        Method, mean error [mm].
    trace : dict of str to ndarray, shape (samples, 2)
        Positions on the circle, for the picture [m].
    unanswered : float
        Largest share of epochs that a method had no answer for.
    """

    errors: dict[str, dict[str, float]]
    table6: dict[str, Array]
    trace: dict[str, Array]
    unanswered: float


def run_bae2022(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run tables 2 to 6 for many seeds."""
    runs = run_seeds(one_run, seeds, progress)
    rows: list[Row] = []
    for path, paper in PAPER_MM.items():
        for method, published in zip(METHODS, paper, strict=True):
            share = 0.2 if method in {'M-HB', 'RWLS'} else 0.1
            spread = Spread.of([run.errors[path][method] for run in runs])
            raw = method == 'LS (T)'
            bound = Bound.within(share, published)
            rows.append(Row(f'{path}, {method}', 'mm', spread, published, raw, bound))
        spread = Spread.of([run.errors[path][OURS] for run in runs])
        rows.append(Row(f'{path}, {OURS}', 'mm', spread, bound=Bound(high=OURS_MM[path])))
    for method, figures in PAPER_TABLE6_MM.items():
        for index, distance in enumerate(TABLE6_DISTANCES_M):
            spread = Spread.of([run.table6[method][index] for run in runs])
            rows.append(Row(f'table 6, {distance:g} m, {method}', 'mm', spread, figures[index]))
    rows.sort(key=lambda row: not row.raw)  # stable: raw rows first
    return Outcome(
        'bae2022',
        'Bae et al. 2022, tables 2 to 6: a tag seen from anchors on the robot',
        tuple(seeds),
        tuple(rows),
        partial(draw, run=runs[0]),
        {
            'range bias [m]': BIASES_M.tolist(),
            'range deviation [m]': NOISE_M,
            'calibration points [m]': _CALIBRATION.tolist(),
            'calibration samples per point': _CALIBRATION_SAMPLES,
            'tracker acceleration [m/s/sqrt(s)]': _TRACKER.acceleration,
        },
        (
            (
                'Ours knows what T_C knows: the mean error of ranges at the four calibration '
                'points, here for each anchor; and that the tag does not jump (a velocity that '
                f'walks by {_TRACKER.acceleration:g} m/s/sqrt(s)). It is causal, no smoother.'
            ),
            (
                'Table 6 is of real hardware; here its layout (tag at 1.0 m, anchors at 0.594 m, '
                '1 to 7 m, five directions) with the range errors of table 1: no bound is set. '
                'The tag stands still, which favours T_F.'
            ),
            f'Largest share of epochs without an answer: {max(r.unanswered for r in runs):.2%}.',
        ),
    )


def one_run(seed: int, samples: int = SAMPLES) -> BaeRun:
    """Return the errors of every method for one seed."""
    rng = np.random.default_rng(seed)
    errors: dict[str, dict[str, float]] = {}
    places: dict[str, Array] = {}
    for path, truth in (('square', square(samples)), ('circle', circle(samples))):
        step = length_of(truth) / len(truth)
        before, ranges = observe(rng, truth, ANCHOR_HEIGHT_M)
        places = locate(before, ranges, ANCHOR_HEIGHT_M)
        places[OURS] = track(before, ranges, step / SPEED_M_S)
        errors[path] = {name: mean_error(place, truth) for name, place in places.items()}
    unanswered = max(float(np.isnan(place).any(axis=1).mean()) for place in places.values())
    table6: dict[str, list[float]] = {name: [] for name in PAPER_TABLE6_MM}
    for distance in TABLE6_DISTANCES_M:
        found: dict[str, list[float]] = {name: [] for name in PAPER_TABLE6_MM}
        for angle in np.radians([0.0, 45.0, 90.0, 135.0, 180.0]):
            place = distance * np.array([np.cos(angle), np.sin(angle)])
            truth = np.tile(place, (TABLE6_SAMPLES * samples // SAMPLES, 1))
            located = locate(*observe(rng, truth, TABLE6_TAG_HEIGHT_M), TABLE6_TAG_HEIGHT_M)
            for name, values in found.items():
                values.append(mean_error(located[name], truth))
        for name, values in found.items():
            table6[name].append(float(np.mean(values)))
    return BaeRun(
        errors, {name: np.array(values) for name, values in table6.items()}, places, unanswered
    )


def square(samples: int) -> Array:
    """Return a turn on a square of 5 m round the robot from (2.5, 0) on, shape (samples, 2)."""
    along = (np.linspace(0.0, 20.0, samples) + 2.5) % 20.0
    side, rest = (along // 5.0).astype(int), along % 5.0 - 2.5
    x = np.choose(side, [2.5, -rest, -2.5, rest])
    return np.column_stack([x, np.choose(side, [rest, 2.5, -rest, -2.5])])


def circle(samples: int) -> Array:
    """Return a turn on a circle of 5 m round the robot from (2.5, 0) on, shape (samples, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, samples)
    return 2.5 * np.column_stack([np.cos(angle), np.sin(angle)])


def length_of(path: Array) -> float:
    """Return the length of a path, shape (k, 2) [m]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def true_ranges(place: Array, tag_height: float) -> Array:
    """Return the slant ranges from places, shape (m, 2), to all anchors, (m, n) [m]."""
    tag = np.column_stack([place, np.full(len(place), tag_height)])
    return np.asarray(np.linalg.norm(tag[:, None] - ANCHORS, axis=2))


def measure(rng: np.random.Generator, place: Array, tag_height: float) -> Array:
    """Return ranges with the errors of table 1, shape (m, n) [m]."""
    exact = true_ranges(place, tag_height)
    return np.asarray(exact + BIASES_M + rng.normal(scale=NOISE_M, size=exact.shape))


def observe(rng: np.random.Generator, truth: Array, tag_height: float) -> tuple[Array, Array]:
    """Return ranges at the calibration points, (k, n), and along a path, (m, n) [m]."""
    return measure(rng, _CALIBRATED_AT, tag_height), measure(rng, truth, tag_height)


def locate(before: Array, ranges: Array, tag_height: float) -> dict[str, Array]:
    """Return what the paper's six methods make of ranges, shape (m, 2) each [m]."""
    linear = solve('linear', ANCHORS, before, NOISE_M, tag_height).position
    found = linear.reshape(len(_CALIBRATION), -1, 2).mean(axis=1)
    corrector = ComponentCorrector(calibrate_bias(_CALIBRATION, found))
    fix = corrector.add(Epochs.of(ANCHORS, ranges, NOISE_M, tag_height))
    return {
        'M-HB': solve('hyperbolic', ANCHORS, ranges, NOISE_M, tag_height).position,
        'LS (T)': fix.raw,
        'RWLS': solve('residual_weighted', ANCHORS, ranges, NOISE_M, tag_height).position,
        'T_C': fix.calibrated,
        'T_R': fix.radial,
        'T_F': fix.filtered,
    }


def track(before: Array, ranges: Array, dt_s: float) -> Array:
    """Return what our tracker makes of the same ranges, shape (m, 2) [m]."""
    biases = (before - true_ranges(_CALIBRATED_AT, ANCHOR_HEIGHT_M)).mean(axis=0)
    tracker = TargetTracker(_TRACKER, ANCHORS, ANCHOR_HEIGHT_M)
    places = np.full((len(ranges), 2), np.nan)
    target = None
    for index, epoch in enumerate(ranges - biases):
        if target is None:
            target = tracker.start(epoch)
        else:
            target = tracker.update(tracker.predict(target, dt_s), epoch).target
        if target is not None:
            places[index] = target.mean[:2]
    return places


def mean_error(place: Array, truth: Array) -> float:
    """Return the mean distance from the truth [mm], of epochs with an answer."""
    return float(1e3 * np.nanmean(np.linalg.norm(place - truth, axis=1)))


def draw(figure: Any, run: BaeRun) -> None:
    """Draw the first seed's circle as each method sees it."""
    for index, name in enumerate(('LS (T)', 'T_C', 'T_F', OURS)):
        axes = figure.add_subplot(1, 4, index + 1)
        axes.plot(*circle(400).T, color='#000000', linewidth=1.0)
        axes.plot(*run.trace[name].T, '.', color='#0072B2', markersize=1.5)
        axes.plot(ANCHORS[:, 0], ANCHORS[:, 1], '^', color='#009E73', markersize=4)
        axes.set_title(f'{name}\n{run.errors["circle"][name]:.0f} mm', loc='left')
        axes.set_aspect('equal')
        axes.set_xlim(-4.2, 4.2)
        axes.set_ylim(-4.2, 4.2)
        axes.set_xlabel('x [m]')
        if not index:
            axes.set_ylabel('y [m]')
