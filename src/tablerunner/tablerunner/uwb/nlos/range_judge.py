"""The test for blocked ranges that a parameter chooses, range by range."""

from __future__ import annotations

import math

from tablerunner.uwb import ranging
from tablerunner.uwb.nlos.range_variance import RangeVariance

NLOS_TESTS = ('signal_quality', 'range_variance', 'none')
"""Tests that judge a single range when it comes, by the names under which they are chosen."""


class RangeJudge:
    """Says how likely each range is blocked.

    Parameters
    ----------
    test : str
        One of `NLOS_TESTS`; ``none`` has never a say.
    gap : tuple of 2 floats
        Centre and width of `ranging.nlos_probability` [dB].
    threshold : float
        Of `RangeVariance` [m^2].
    window : int
        Of `RangeVariance`.
    """

    def __init__(self, test: str, gap: tuple[float, float], threshold: float, window: int) -> None:
        self._test = test
        self._gap = gap
        self._threshold, self._window = threshold, window
        self._series: dict[str, RangeVariance] = {}

    def reset(self) -> None:
        """Forget all ranges."""
        self._series.clear()

    def probability(
        self, anchor_id: str, range_m: float, rx_power_dbm: float, first_path_power_dbm: float
    ) -> float:
        """Return the probability that a range is blocked, NaN where the test has no say."""
        if self._test == 'signal_quality':
            return ranging.nlos_probability(rx_power_dbm, first_path_power_dbm, *self._gap)
        if self._test == 'range_variance':
            series = self._series.get(anchor_id)
            if series is None:
                series = self._series[anchor_id] = RangeVariance(self._threshold, self._window)
            return float(series.add(range_m).probability)
        return math.nan
