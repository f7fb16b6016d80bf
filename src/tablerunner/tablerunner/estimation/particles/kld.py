"""How many particles are enough: KLD sampling (Fox 2003).

If samples are drawn from a histogram of k bins, then with n of them the Kullback-Leibler distance
between what they show and the histogram stays below e with probability 1 - d, where

    n = (k - 1) / (2 e)  (1 - 2/(9 (k - 1)) + sqrt(2/(9 (k - 1))) z)^3

z being the upper 1 - d quantile of the standard normal distribution (Wilson and Hilferty's
approximation of chi-square with k - 1 degrees of freedom). Fox counts bins while he draws; here
the particles before resampling say how many there are.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtri

from tablerunner.types import Matrix


def enough(bins: int, error: float, confidence: float) -> int:
    """Return how many particles it takes (Fox 2003, eq. 13).

    Parameters
    ----------
    bins : int
        Occupied ones, k.
    error : float
        Largest Kullback-Leibler distance, e.
    confidence : float
        Probability 1 - d with which it is kept.
    """
    if bins <= 1:
        return 1
    free = bins - 1
    spread = 2.0 / (9.0 * free)
    root = 1.0 - spread + math.sqrt(spread) * float(ndtri(confidence))
    return math.ceil(free / (2.0 * error) * root**3)


def occupied(places: Matrix, size: tuple[float, ...]) -> int:
    """Return how many bins of a grid hold something.

    Parameters
    ----------
    places : ndarray, shape (n, d)
    size : tuple of float
        Sides of a bin.
    """
    cells = np.floor(places / np.asarray(size)).astype(np.int64)
    cells -= cells.min(axis=0)
    flat = cells[:, 0]
    for column in range(1, cells.shape[1]):
        flat = flat * (int(cells[:, column].max()) + 1) + cells[:, column]
    return len(np.unique(flat))
