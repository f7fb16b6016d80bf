"""The drift of a gyroscope as it wanders: a constant, and a step now and then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.survey.track import Pieces
from tablerunner.types import NANOSECONDS

Array = NDArray[np.float64]

STEP_S = 15.0
"""How long the drift is taken to be constant."""

WALK = 0.0003
"""How it wanders [rad/s/sqrt(s)]."""


def drift_times(pieces: Pieces) -> Array:
    """Return what the turn of each piece gains by a unit of the drift, and of each of its steps.

    Returns
    -------
    ndarray, shape (k - 1, 1 + steps)
        How much of a piece lies after the start, and after each step [s].
    """
    times = (pieces.stamps - pieces.stamps[0]) / NANOSECONDS
    steps = np.concatenate([[0.0], np.arange(STEP_S, times[-1] - 0.5 * STEP_S, STEP_S)])
    after = np.maximum(times[:, None] - steps, 0.0)
    return np.asarray(np.diff(after, axis=0))


def drift_priors(columns: Array, drift_std: float) -> Array:
    """Return the standard deviations of the drift and of its steps [rad/s]."""
    count = columns.shape[1]
    return np.concatenate([[drift_std], np.full(count - 1, WALK * np.sqrt(STEP_S))])
