"""NLOS from how ranges jump: variance of consecutive differences in a window (Liu 12-13).

A tag that moves slowly changes its clear ranges smoothly; a range that is blocked now and then
jumps. Liu takes the variance of the sizes of k consecutive differences: for clear ranges of
standard deviation s it is 2 (1 - 2/pi) s^2 = 0.73 s^2, and jumps of size J in a share q of
differences add about q J^2.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tablerunner.errors import GeometryError
from tablerunner.uwb.nlos.verdict import Array, NlosVerdict, logistic

WINDOW = 50
"""Differences in the window: the paper's, at 3 Hz."""

CLEAR_SHARE = 2.0 * (1.0 - 2.0 / np.pi)
"""Variance of the size of differences of clear ranges, over the variance of one range."""

LEAST_DIFFERENCES = 8
"""Fewer differences than this have no say."""

_SHARPNESS = 4.0  # how fast probability changes with the logarithm of variance over threshold


def variance_threshold(range_std: float, factor: float = 3.0) -> float:
    """Return a threshold for the variance [m^2]: `factor` times what clear ranges have."""
    return factor * CLEAR_SHARE * range_std**2


class RangeVariance:
    """The test for one anchor, fed range by range.

    Parameters
    ----------
    threshold : float
        Variance above which a range counts as blocked [m^2]; see `variance_threshold`.
    window : int
        Differences that count.
    """

    def __init__(self, threshold: float, window: int = WINDOW) -> None:
        _check(threshold, window)
        self._threshold = threshold
        self._sizes: deque[float] = deque(maxlen=window)
        self._last = float('nan')

    def reset(self) -> None:
        """Forget all ranges."""
        self._sizes.clear()
        self._last = float('nan')

    def add(self, range_m: float) -> NlosVerdict:
        """Take the next range [m] and judge it; over a gap, NaN, no difference is taken."""
        size = abs(range_m - self._last)
        self._last = range_m
        if np.isfinite(size):
            self._sizes.append(size)
        if not np.isfinite(range_m) or len(self._sizes) < min(
            LEAST_DIFFERENCES, self._sizes.maxlen or LEAST_DIFFERENCES
        ):
            return NlosVerdict.of(float('nan'))
        return _verdict(np.asarray(np.var(list(self._sizes), ddof=1)), self._threshold)


def judge_variance(ranges: Array, threshold: float, window: int = WINDOW) -> NlosVerdict:
    """Return the verdicts on whole series, each range from the differences up to it.

    Parameters
    ----------
    ranges : ndarray, shape (m, n)
        Consecutive ranges to n anchors [m]; NaN where one is missing.
    threshold : float
        [m^2].
    window : int
        Differences that count, here the last ones in time whether they are there or not.
    """
    _check(threshold, window)
    sizes = np.abs(np.diff(ranges, axis=0))
    padded = np.full((window + len(sizes), ranges.shape[1]), np.nan)
    padded[window:] = sizes
    view = sliding_window_view(padded, window, axis=0)  # (m, n, window), the last window of each
    there = np.isfinite(view)
    count = there.sum(axis=-1)
    mean = np.where(there, view, 0.0).sum(axis=-1) / np.maximum(count, 1)
    square = np.where(there, (view - mean[..., None]) ** 2, 0.0).sum(axis=-1)
    enough = (count >= min(LEAST_DIFFERENCES, window)) & np.isfinite(ranges)
    variance = np.where(enough, square / np.maximum(count - 1, 1), np.nan)
    return _verdict(variance, threshold)


def _verdict(variance: Array, threshold: float) -> NlosVerdict:
    with np.errstate(divide='ignore'):
        return NlosVerdict.of(logistic(_SHARPNESS * np.log(variance / threshold)))


def _check(threshold: float, window: int) -> None:
    if not (np.isfinite(threshold) and threshold > 0.0):
        raise GeometryError(f'the threshold of the variance is {threshold}, above 0 is needed')
    if window < 2:
        raise GeometryError(f'a window of {window} differences has no variance')
