"""Errors of many runs, kept whole, as distances only, or as four figures of each run.

A thousand runs of a minute and a half at 10 Hz are 900 000 places. What is kept of them:

=========  ===========================================  ======================
`keep`     what                                         bytes for each run
=========  ===========================================  ======================
summary    largest, mean, RMS and final error           32
errors     the distance at each stamp, too              32 + 8 k
all        the estimated place at each stamp, too       32 + 24 k
=========  ===========================================  ======================

with k stamps. Nothing else grows with the number of stamps while errors are being added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError

Array = NDArray[np.float64]

KEEP = ('summary', 'errors', 'all')
"""How much may be kept, the least first."""


@dataclass(frozen=True)
class KeptErrors:
    """Errors of position of many runs [m].

    Attributes
    ----------
    largest, mean, rms, final : ndarray, shape (runs,)
        NaN for a run without any.
    errors : ndarray, shape (k, runs), or None
        NaN where a run had ended, or nothing was added; None where they were not kept.
    places : ndarray, shape (k, 2, runs), or None
        Estimated places, likewise.
    """

    largest: Array
    mean: Array
    rms: Array
    final: Array
    errors: Array | None = None
    places: Array | None = None


class ErrorKeeper:
    """Compares places with the truth, stamp by stamp, and keeps as much as was asked for.

    Parameters
    ----------
    keep : str
        One of `KEEP`.
    truth : ndarray, shape (k, 2, runs)
        True places [m].
    counts : ndarray of bool, shape (k, runs)
        Which stamps belong to each run.

    Raises
    ------
    ConfigError
        `keep` is none of them.
    """

    def __init__(self, keep: str, truth: Array, counts: NDArray[np.bool_]) -> None:
        if keep not in KEEP:
            raise ConfigError('keep', keep, 'one of ' + ', '.join(KEEP))
        self._truth, self._counts = truth, counts
        stamps, _, runs = truth.shape
        self._number = np.zeros(runs, dtype=np.int64)
        self._largest = np.full(runs, -np.inf)
        self._sum, self._squares = np.zeros(runs), np.zeros(runs)
        self._final = np.full(runs, np.nan)
        self._errors = None if keep == 'summary' else np.full((stamps, runs), np.nan)
        self._places = np.full((stamps, 2, runs), np.nan) if keep == 'all' else None

    def add(self, index: int, places: Array) -> None:
        """Take the places, shape (runs, 2) [m], of a stamp; stamps in their order."""
        counts, truth = self._counts[index], self._truth[index]
        error = np.hypot(places[:, 0] - truth[0], places[:, 1] - truth[1])
        self._number += counts
        self._largest = np.where(counts, np.maximum(self._largest, error), self._largest)
        self._sum += np.where(counts, error, 0.0)
        self._squares += np.where(counts, error**2, 0.0)
        self._final = np.where(counts, error, self._final)
        if self._errors is not None:
            self._errors[index] = np.where(counts, error, np.nan)
        if self._places is not None:
            self._places[index] = np.where(counts, places.T, np.nan)

    def result(self) -> KeptErrors:
        """Return what was kept."""
        some = self._number > 0
        number = np.where(some, self._number, 1)
        return KeptErrors(
            np.where(some, self._largest, np.nan),
            np.where(some, self._sum / number, np.nan),
            np.where(some, np.sqrt(self._squares / number), np.nan),
            self._final,
            self._errors,
            self._places,
        )
