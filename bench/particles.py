"""Particle filters: a step of `pf_uiekf` against a loop over filterpy's EKFs, and how N counts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from result import Result

from tablerunner.estimation import ESTIMATORS, EstimatorConfig, Start
from tablerunner.estimation.particles.config import ParticleConfig
from tablerunner.estimation.particles.growth_model import GrowthModel
from tablerunner.estimation.particles.iterated import UIEKF, covariance_of, update
from tablerunner.estimation.particles.kernel import square_root
from tablerunner.estimation.particles.sight import ranges_of
from tablerunner.estimation.particles.swarm import rotation
from tablerunner.experiments.pf_uiekf import follow, simulate
from tablerunner.odometry import Motion
from tablerunner.types import Anchor, Estimate, RangeSample

COUNT = 1000
ROUNDS = 5
LEVER = (0.0, 0.0, 1.1)
PLACES = [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]
ANCHORS = tuple(Anchor(f'A{i}', place) for i, place in enumerate(PLACES))
TRUE = (5.2, 6.1, 1.1)
VARIANCE = 0.01
MEASURED = np.array([math.dist(place, TRUE) for place in PLACES])
MEASURED += np.array([0.04, -0.08, 0.02, 0.06])
SAMPLES = tuple(
    RangeSample(2, anchor.anchor_id, 'tag', 0, float(value), VARIANCE)
    for anchor, value in zip(ANCHORS, MEASURED, strict=True)
)
MOTION = Motion(0.05, 0.02, 0.1)


def started(count: int) -> tuple[Callable[[], Estimate], Estimate]:
    """Return a step of `pf_uiekf` (a motion and four ranges), and what it begins with."""
    config = EstimatorConfig(
        gate=1e6, particles=ParticleConfig(least=count, at_start=count, threshold=0.0)
    )
    estimator = ESTIMATORS['pf_uiekf'](config, ANCHORS, LEVER)
    first = estimator.start(Start(1, np.array([5.0, 6.0, 0.3]), np.diag([0.04, 0.04, 0.02])))
    # Drawn once, so that the particles lie apart.
    drawn, _ = estimator.update_ranges(first, SAMPLES)

    def step() -> Estimate:
        moved = estimator.predict(drawn, MOTION, 2)
        return estimator.update_ranges(moved, SAMPLES)[0]

    return step, drawn


def loop(
    means: np.ndarray, covariances: np.ndarray, noise: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Do the same for each particle with filterpy's EKF; return its means and covariances.

    Iterated as its documentation shows for one update, with the residual of the iterated filter;
    no particle here needs damping. Predicted by its `predict`, drawn and weighed after.
    """
    count = len(means)
    found, spreads, log_weights = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty(count)
    places = np.array(PLACES)

    def slope(x: np.ndarray) -> np.ndarray:
        off = np.array([x[0], x[1], LEVER[2]]) - places
        distance = np.sqrt((off**2).sum(axis=1))
        return np.column_stack([off[:, :2] / distance[:, None], np.zeros(4)])

    def expected(x: np.ndarray) -> np.ndarray:
        return np.sqrt(((np.array([x[0], x[1], LEVER[2]]) - places) ** 2).sum(axis=1))

    ekf = ExtendedKalmanFilter(dim_x=3, dim_z=4)
    ekf.R, ekf.F, ekf.Q = noise, np.eye(3), np.zeros((3, 3))
    inverse = np.linalg.inv(noise)
    for i in range(count):
        ekf.x, ekf.P = means[i].copy(), covariances[i]
        ekf.predict()
        prior, spread, at = ekf.x.copy(), ekf.P.copy(), ekf.x.copy()
        information = np.linalg.inv(spread)
        for _ in range(UIEKF.steps):
            ekf.x, ekf.P = prior.copy(), spread.copy()
            ekf.update(
                MEASURED,
                lambda x, at=at: slope(at),
                lambda x, at=at: expected(at) + slope(at) @ (x - at),
            )
            step, at = ekf.x - at, ekf.x.copy()
            if step @ np.linalg.solve(ekf.P, step) < UIEKF.tolerance**2:
                break
        found[i], spreads[i] = at, ekf.P
        x = rng.multivariate_normal(at, ekf.P)
        off = MEASURED - expected(x)
        likelihood = -0.5 * off @ inverse @ off
        motion = -0.5 * (x - prior) @ information @ (x - prior)
        proposal = -0.5 * (x - at) @ np.linalg.solve(ekf.P, x - at)
        log_weights[i] = likelihood + motion - proposal
    log_weights -= log_weights.max()
    return found, spreads


def against_filterpy() -> tuple[float, float]:
    """Return the times of a step [ms], ours and the loop's, after checking that they agree.

    Raises
    ------
    RuntimeError
        The proposals differ.
    """
    step, drawn = started(COUNT)
    config = EstimatorConfig()
    estimator = ESTIMATORS['pf_uiekf'](config, ANCHORS, LEVER)
    swarm = estimator.predict(drawn, MOTION, 2).carried
    poses = swarm.now()
    roots = rotation(poses[:, 2] - swarm.way.moved[2]) @ square_root(
        swarm.pose_noise + np.diag([1e-6, 1e-6, 1e-6])  # filterpy's needs an inverse
    )
    covariances = roots @ np.swapaxes(roots, 1, 2)
    noise = np.eye(4) * VARIANCE + swarm.bias_covariance

    def look(states: np.ndarray, _rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        expected, slope = ranges_of(states, PLACES, LEVER)
        return MEASURED - expected, slope

    ours = update(poses, roots, look, noise, UIEKF)
    theirs, spreads = loop(poses, covariances, noise, np.random.default_rng(0))
    apart = np.abs(ours.mean - theirs) / np.sqrt(np.diagonal(spreads, axis1=1, axis2=2))
    wider = covariance_of(roots, ours) / spreads.max(axis=(1, 2), keepdims=True)
    wider -= spreads / spreads.max(axis=(1, 2), keepdims=True)
    if not (apart.max() < 1e-2 and np.abs(wider).max() < 1e-2):
        raise RuntimeError(f'proposals differ by {apart.max():.3g} deviations')
    mine = min(_seconds(step) for _ in range(2 * ROUNDS))
    rng = np.random.default_rng(0)
    reference = min(_seconds(lambda: loop(poses, covariances, noise, rng)) for _ in range(2))
    return 1e3 * mine, 1e3 * reference


def _seconds(run: Callable[[], object]) -> float:
    begun = time.process_time()
    run()
    return time.process_time() - begun


def benchmark_run(count: int) -> float:
    """Return the time of one run of the paper's benchmark [ms]."""
    model = GrowthModel()
    truth, measured = simulate(model, np.random.default_rng(0))
    runs = [follow(model, 'pf_uiekf', count, truth, measured, 0) for _ in range(ROUNDS)]
    return 1e3 * min(run.seconds for run in runs)


def measure() -> Iterator[Result]:
    """Measure all."""
    mine, reference = against_filterpy()
    yield Result(
        'pf_uiekf step, 1000 particles',
        mine,
        reference,
        reference / mine,
        'ms',
        'motion, four ranges, no resampling; reference: a loop over filterpy EKFs, iterated alike',
        bound=50.0,
        at_most=False,
    )
    times = {}
    for count in (1_000, 10_000, 100_000):
        step, _ = started(count)
        times[count] = 1e9 * min(_seconds(step) for _ in range(ROUNDS)) / count
    yield Result(
        'pf_uiekf, 100 000 particles',
        times[100_000],
        times[1_000],
        times[100_000] / times[1_000],
        'ns/particle',
        f'the same step; reference: 1 000 particles; 10 000: {times[10_000]:.0f}',
        bound=2.0,
    )
    few, many = benchmark_run(20), benchmark_run(200)
    yield Result(
        'pf_uiekf benchmark, N = 200',
        many,
        few,
        many / few,
        'ms',
        "60 steps of the paper's benchmark; reference: N = 20",
        bound=2.0,
    )
