"""The path of a replay, smoothed: from its first odometry on, with all that came later known."""

from __future__ import annotations

import numpy as np

from tablerunner.bags.replay import Estimates, ReplayResult
from tablerunner.errors import ConfigError
from tablerunner.estimation.smoother import SMOOTHED, extend_back, smooth
from tablerunner.evaluation.errors import ErrorSeries, compare
from tablerunner.types import Estimate


def smooth_replay(result: ReplayResult) -> Estimates:
    """Return the smoothed path of a replay, one row for each instant.

    Each run of the estimator (a new one begins where it was lost and found) is smoothed by itself,
    and led back by odometry to where the search for its start began, but not into the run before.

    Parameters
    ----------
    result : ReplayResult
        Of a replay with `ReplayConfig.keep`.

    Raises
    ------
    ConfigError
        The estimator is none that can be smoothed.
    """
    if result.estimator not in SMOOTHED:
        raise ConfigError(
            'smooth', result.estimator, 'one of ' + ', '.join(SMOOTHED) + ' as estimator'
        )
    path: dict[int, Estimate] = {}
    newest = -1
    for run in result.runs:
        smoothed = smooth(run)
        earlier = [item for item in extend_back(run, smoothed[0]) if item.stamp > newest]
        # Of several estimates for one time all say the same once everything is known.
        path.update((item.stamp, item) for item in [*earlier, *smoothed])
        newest = max(path)
    stamps = sorted(path)
    return Estimates(
        np.array(stamps, dtype=np.int64),
        np.array([path[stamp].mean[:3] for stamp in stamps]).reshape(-1, 3),
        np.array([path[stamp].covariance[:3, :3] for stamp in stamps]).reshape(-1, 3, 3),
        np.ones(len(stamps), dtype=bool),
    )


def smoothed_errors(result: ReplayResult) -> ErrorSeries:
    """Return the errors of the smoothed path against the truth; errors as `smooth_replay`."""
    path = smooth_replay(result)
    return compare(path.stamps, path.poses, result.truth, path.covariances)
