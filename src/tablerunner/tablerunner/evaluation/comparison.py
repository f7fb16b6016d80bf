"""Several estimators on the same runs: their errors, whether they knew them, and the bound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tablerunner.evaluation.run_average import RunAverage, run_average
from tablerunner.types import Matrix, Vector


@dataclass(frozen=True)
class EstimatorRuns:
    """One estimator on all runs.

    Attributes
    ----------
    name : str
    errors : ndarray, shape (runs, steps, 3)
        Estimate minus truth: x, y [m], heading [rad]; NaN where it knew no pose.
    deviations : ndarray, shape (runs, steps, 3)
        What it believed of them.
    nees : ndarray, shape (runs, steps)
        Of the whole pose, three dimensions.
    nis, nis_dimensions : ndarray, shape (runs, exchanges)
        Of measurements that it took; NaN where there was none.
    """

    name: str
    errors: Matrix
    deviations: Matrix
    nees: Matrix
    nis: Matrix
    nis_dimensions: Matrix

    @property
    def distances(self) -> Matrix:
        """Distances from the truth, shape (runs, steps) [m]."""
        return np.asarray(np.hypot(self.errors[..., 0], self.errors[..., 1]))

    @property
    def known(self) -> float:
        """Share of all steps at which it knew a pose."""
        return float(np.mean(np.isfinite(self.distances)))

    @property
    def rmse(self) -> float:
        """Root mean square distance over all runs and steps [m]."""
        return _rms(self.distances)

    @property
    def mean(self) -> float:
        """Mean distance over all runs and steps [m]."""
        return _of_known(np.mean, self.distances)

    @property
    def max(self) -> float:
        """Greatest distance in all runs [m]."""
        return _of_known(np.max, self.distances)

    @property
    def heading_rmse(self) -> float:
        """Root mean square error of the heading [rad]."""
        return _rms(self.errors[..., 2])

    @property
    def believed_rmse(self) -> float:
        """What the estimator believed its `rmse` to be [m]."""
        return _rms(np.hypot(self.deviations[..., 0], self.deviations[..., 1]))

    @property
    def rmse_of_runs(self) -> Vector:
        """Root mean square distance of each run, shape (runs,) [m]."""
        return np.array([_rms(row) for row in self.distances])

    @property
    def heading_rmse_of_runs(self) -> Vector:
        """Root mean square error of the heading of each run, shape (runs,) [rad]."""
        return np.array([_rms(row) for row in self.errors[..., 2]])

    @property
    def average_nees(self) -> RunAverage:
        """NEES averaged over runs, for each dimension."""
        return run_average(self.nees, 3)

    @property
    def average_nis(self) -> RunAverage:
        """NIS averaged over runs, for each dimension."""
        return run_average(self.nis, self.nis_dimensions)


@dataclass(frozen=True)
class Comparison:
    """All estimators on all runs, cut to the length of the shortest.

    Attributes
    ----------
    title : str
        Of the scenario, for people.
    seeds : tuple of int
        One for each run.
    times : ndarray, shape (steps,)
        Since the start [s].
    range_times : ndarray, shape (exchanges,)
        Of ranges, lost ones included [s].
    bounds : ndarray, shape (runs, steps, 3)
        Least mean square errors of x, y [m^2], heading [rad^2] along each run's truth.
    estimators : tuple of EstimatorRuns
    """

    title: str
    seeds: tuple[int, ...]
    times: Vector
    range_times: Vector
    bounds: Matrix
    estimators: tuple[EstimatorRuns, ...]

    @property
    def bound_over_time(self) -> Matrix:
        """Mean of the bounds over runs, shape (steps, 3)."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def bound_rmse(self) -> float:
        """Least root mean square distance from the truth [m]."""
        return float(np.sqrt(np.mean(self.bounds[..., :2].sum(axis=-1))))

    @property
    def bound_heading_rmse(self) -> float:
        """Least root mean square error of the heading [rad]."""
        return float(np.sqrt(np.mean(self.bounds[..., 2])))

    def as_json(self) -> dict[str, Any]:
        """Return the figures as what JSON knows: lengths in m, angles in rad."""
        return {
            'title': self.title,
            'seeds': list(self.seeds),
            'steps': len(self.times),
            'bound': {'rmse': self.bound_rmse, 'heading_rmse': self.bound_heading_rmse},
            'estimators': [self._figures(item) for item in self.estimators],
        }

    def _figures(self, item: EstimatorRuns) -> dict[str, Any]:
        nees, nis = item.average_nees, item.average_nis
        return {
            'estimator': item.name,
            'rmse': item.rmse,
            'mean': item.mean,
            'max': item.max,
            'heading_rmse': item.heading_rmse,
            'ratio_to_bound': item.rmse / self.bound_rmse,
            'heading_ratio_to_bound': item.heading_rmse / self.bound_heading_rmse,
            'believed_rmse': item.believed_rmse,
            'nees_mean': nees.mean,
            'nees_inside': nees.inside,
            'nis_mean': nis.mean,
            'nis_inside': nis.inside,
            'pose_known': item.known,
        }

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the figures of each run and estimator, as the lines of a table."""
        for run, seed in enumerate(self.seeds):
            bound = float(np.sqrt(np.mean(self.bounds[run, :, :2].sum(axis=-1))))
            for item in self.estimators:
                distances = item.distances[run]
                yield {
                    'seed': seed,
                    'estimator': item.name,
                    'rmse_m': _rms(distances),
                    'mean_m': _of_known(np.mean, distances),
                    'max_m': _of_known(np.max, distances),
                    'heading_rmse_rad': _rms(item.errors[run, :, 2]),
                    'nees_mean': _of_known(np.mean, item.nees[run]) / 3.0,
                    'nis_mean': _of_known(np.mean, item.nis[run] / item.nis_dimensions[run]),
                    'bound_rmse_m': bound,
                }


def _of_known(measure: Any, values: Matrix) -> float:
    known = values[np.isfinite(values)]
    return float(measure(known)) if known.size else float('nan')


def _rms(values: Matrix) -> float:
    return float(np.sqrt(_of_known(np.mean, np.square(values))))
