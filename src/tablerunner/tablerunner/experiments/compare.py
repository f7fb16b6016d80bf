"""All estimators on the same simulated drives, beside the posterior Cramer-Rao bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.errors import ConfigError
from tablerunner.estimation.registry import ESTIMATORS
from tablerunner.evaluation.bound import posterior_bound
from tablerunner.evaluation.comparison import Comparison, EstimatorRuns
from tablerunner.evaluation.consistency import nees
from tablerunner.evaluation.errors import compare
from tablerunner.evaluation.truth import Truth
from tablerunner.experiments.belief import Belief, Sensed, believe, sense
from tablerunner.experiments.drive import Drive, Route, drive_route
from tablerunner.experiments.experiment import Progress
from tablerunner.experiments.matched import bound_model, matched
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import Contact, RangeTruth
from tablerunner.types import Innovation, LosState, Matrix, RangeSample, Vector

START_STD = (0.05, 0.05, 0.02)
"""Deviations of the start that estimators are given from the true one [m, m, rad]."""


@dataclass(frozen=True)
class Setup:
    """What is compared on what.

    Attributes
    ----------
    scenario : Scenario
    route : tuple of (x, y)
        Points after the start [m].
    estimators : tuple of str
    speed : float
        [m/s].
    config : ReplayConfig or None
        Settings of all that estimates; None: matched to the sensors of the scenario (`matched`).
    """

    scenario: Scenario
    route: Route
    estimators: tuple[str, ...]
    speed: float = 0.5
    config: ReplayConfig | None = None

    def __post_init__(self) -> None:
        """Refuse what there is not."""
        if not self.estimators:
            raise ConfigError('--estimators', '', 'at least one of ' + ', '.join(ESTIMATORS))
        for name in self.estimators:
            if name not in ESTIMATORS:
                raise ConfigError('--estimators', name, 'one of ' + ', '.join(ESTIMATORS))
        if not 0.0 < self.speed <= self.scenario.robot.limits.speed:
            fastest = f'more than 0, at most {self.scenario.robot.limits.speed} m/s'
            raise ConfigError('--speed', self.speed, fastest)

    @property
    def settings(self) -> ReplayConfig:
        """Settings of everything that estimates."""
        return self.config or matched(self.scenario, self.speed)


@dataclass(frozen=True)
class Run:
    """One estimator on the drive of one seed.

    Attributes
    ----------
    errors : ndarray, shape (steps, 3)
        Estimate minus truth at each odometry: x, y [m], heading [rad]; NaN where it knew no pose.
    deviations : ndarray, shape (steps, 3)
        What it believed of them.
    nees : ndarray, shape (steps,)
        Of the whole pose.
    nis : ndarray, shape (exchanges,)
        Of the measurement that came with each exchange and was accepted; NaN where none was, or
        where the range was judged to be blocked: its variance then says that it is not believed.
    nis_dimensions : ndarray, shape (exchanges,)
    """

    errors: Matrix
    deviations: Matrix
    nees: Vector
    nis: Vector
    nis_dimensions: Vector


@dataclass(frozen=True)
class Seed:
    """All estimators on one drive.

    Attributes
    ----------
    seed : int
    times : ndarray, shape (steps,)
        Of odometry, since the start [s].
    range_times : ndarray, shape (exchanges,)
        Of all exchanges, lost ones included [s].
    bound : ndarray, shape (steps, 3)
        Least mean square errors of x, y [m^2], heading [rad^2].
    runs : dict of str to Run
        By estimator.
    blocked : float
        Share of the ranges that were blocked.
    contacts : int
        How often the robot touched something: its wheels then turn without way.
    """

    seed: int
    times: Vector
    range_times: Vector
    bound: Matrix
    runs: dict[str, Run] = field(default_factory=dict)
    blocked: float = 0.0
    contacts: int = 0


def run_compare(
    setup: Setup,
    seeds: Sequence[int],
    progress: Progress = lambda done, count: None,
    workers: int | None = None,
) -> list[Seed]:
    """Return all runs, in the order of the seeds; the same for any number of workers."""
    return run_seeds(partial(one_seed, setup=setup), seeds, progress, workers)


def clear_of(scenario: Scenario) -> Scenario:
    """Return a scenario in which nothing can stand between tag and anchors.

    The robot, its sensors and their errors stay as they are: runs of the same seed are alike but
    for what was blocked.
    """
    return scenario.replace(people=(), walls=(), tables=(), boxes=())


def compared(setup: Setup, seeds: Sequence[Seed]) -> Comparison:
    """Put runs beside each other, cut to the shortest: the driver needs a little more or less.

    Raises
    ------
    ConfigError
        There are none.
    """
    if not seeds:
        raise ConfigError('--seeds', 0, 'at least one')
    steps = min(len(item.times) for item in seeds)
    exchanges = min(len(item.range_times) for item in seeds)
    estimators = []
    for name in setup.estimators:
        runs = [item.runs[name] for item in seeds]
        estimators.append(
            EstimatorRuns(
                name,
                np.array([run.errors[:steps] for run in runs]),
                np.array([run.deviations[:steps] for run in runs]),
                np.array([run.nees[:steps] for run in runs]),
                np.array([run.nis[:exchanges] for run in runs]),
                np.array([run.nis_dimensions[:exchanges] for run in runs]),
            )
        )
    return Comparison(
        setup.scenario.name,
        tuple(item.seed for item in seeds),
        seeds[0].times[:steps],
        seeds[0].range_times[:exchanges],
        np.array([item.bound[:steps] for item in seeds]),
        tuple(estimators),
    )


def one_seed(seed: int, setup: Setup) -> Seed:
    """Drive once, and run every estimator and the bound on it."""
    # Nobody listens to the ultrasonics, and what else is drawn does not depend on them.
    quiet = setup.scenario.replace(robot=replace(setup.scenario.robot, ultrasonics=()))
    drive = drive_route(quiet, seed, setup.route, setup.speed)
    truth = truth_of(drive)
    exchanges = [item for item in drive.samples if isinstance(item, RangeTruth)]
    begin = int(drive.stamps[0])
    range_stamps = np.array([item.stamp for item in exchanges], dtype=np.int64)
    config = setup.settings
    sensed = sense(drive, config.ranger, config.odometer)
    start = drive.poses[0] + stream(seed, 'compare start').standard_normal(3) * START_STD
    runs = {}
    for name in setup.estimators:
        localizer = replace(
            config.localizer,
            estimator=name,
            initial_pose=tuple(float(value) for value in start),
            initial_pose_std=START_STD,
        )
        belief = believe(sensed, localizer, config.ranger.anchors)
        runs[name] = judge(belief, truth, range_stamps, sensed)
    clear = [item for item in exchanges if not item.lost and not item.blocked_by]
    index = {anchor.id: row for row, anchor in enumerate(setup.scenario.anchors)}
    bound = posterior_bound(
        bound_model(setup.scenario, setup.speed, START_STD),
        truth,
        np.array([item.stamp for item in clear], dtype=np.int64),
        [index[item.anchor_id] for item in clear],
    )
    return Seed(
        seed,
        _since(drive.stamps, begin),
        _since(range_stamps, begin),
        np.diagonal(bound, axis1=1, axis2=2),
        runs,
        float(np.mean([bool(item.blocked_by) for item in exchanges])) if exchanges else 0.0,
        sum(isinstance(item, Contact) for item in drive.samples),
    )


def _since(stamps: NDArray[np.int64], begin: int) -> Vector:
    return np.asarray((stamps - begin) * 1e-9, dtype=np.float64)


def truth_of(drive: Drive) -> Truth:
    """Return the true path of a drive."""
    return Truth.from_poses(
        (int(stamp), Pose2(*pose), True)
        for stamp, pose in zip(drive.stamps, drive.poses, strict=True)
    )


def judge(
    belief: Belief, truth: Truth, range_stamps: NDArray[np.int64], sensed: Sequence[Sensed]
) -> Run:
    """Return the errors of a belief at all times of the truth."""
    series = compare(belief.stamps, belief.poses, truth, belief.covariances)
    rows = np.searchsorted(truth.stamps, series.stamps)
    at_truth = truth.stamps[rows.clip(0, len(truth) - 1)] == series.stamps
    rows = rows[at_truth]
    errors, deviations = np.full((2, len(truth), 3), np.nan)
    errors[rows] = series.errors[at_truth]
    covariances = series.covariances[at_truth]
    deviations[rows] = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    normalised = np.full(len(truth), np.nan)
    normalised[rows] = nees(series.errors[at_truth], covariances)
    nis, dimensions = _nis(belief.innovations, range_stamps, sensed)
    return Run(errors, deviations, normalised, nis, dimensions)


def _nis(
    innovations: Sequence[Innovation], range_stamps: NDArray[np.int64], sensed: Sequence[Sensed]
) -> tuple[Vector, Vector]:
    blocked = {
        item.stamp
        for item in sensed
        if isinstance(item, RangeSample) and item.los is LosState.NLOS
    }
    rows = {int(stamp): row for row, stamp in enumerate(range_stamps)}
    values, dimensions = np.full(len(rows), np.nan), np.ones(len(rows))
    for item in innovations:
        row = rows.get(item.stamp)
        if row is not None and item.accepted and item.considered and item.stamp not in blocked:
            values[row], dimensions[row] = item.nis, max(len(item.innovation), 1)
    return values, dimensions
