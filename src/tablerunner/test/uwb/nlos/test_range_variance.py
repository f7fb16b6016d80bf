"""The variance test: quiet on clear ranges, loud on jumps, and the same fed either way."""

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb.nlos import RangeVariance, judge_variance, variance_threshold
from tablerunner.uwb.nlos.range_variance import CLEAR_SHARE, LEAST_DIFFERENCES

STD = 0.05
THRESHOLD = variance_threshold(STD)


def clear(rng, count=400):
    """Return ranges at 3 Hz to a tag that goes away and comes back at 0.2 m/s."""
    time = np.arange(count) / 3.0
    return 5 + 3 * np.sin(0.2 / 3 * time) + rng.normal(0, STD, count)


def test_variance_of_clear_differences_has_its_known_share():
    """The variance of sizes of differences of clear ranges is 0.73 of that of one range."""
    ranges = np.random.default_rng(1).normal(5, STD, 200_000)
    assert np.var(np.abs(np.diff(ranges))) / STD**2 == pytest.approx(CLEAR_SHARE, rel=0.02)


def test_judge_variance_clear_ranges_are_clear_and_jumps_are_not():
    """Over many seeds: under 2 % false alarms, over 95 % of a jumping stretch found."""
    false, found = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        ranges = clear(rng)
        ranges[200:300] += (rng.random(100) < 0.5) * rng.exponential(1.0, 100)
        blocked = judge_variance(ranges[:, None], THRESHOLD).blocked[:, 0]
        false.append(blocked[:200].mean())
        found.append(blocked[220:300].mean())
    assert np.mean(false) < 0.02
    assert np.mean(found) > 0.95


def test_judge_variance_rises_with_the_variance_and_is_even_at_the_threshold():
    """The probability is one half where the variance is the threshold."""
    sizes = np.tile([0.0, 0.3], 30)
    ranges = np.cumsum(np.concatenate([[5.0], sizes]))
    variance = np.var(sizes[:50], ddof=1)
    at = [judge_variance(ranges[:51, None], variance * k).probability[-1, 0] for k in (0.5, 1, 2)]
    assert at[1] == pytest.approx(0.5)
    assert at[0] > 0.9 > 0.1 > at[2]


def test_range_variance_fed_one_by_one_equals_the_series():
    """The stateful test and the array give the same, as long as no range is missing."""
    ranges = clear(np.random.default_rng(3), 120)
    ranges[60:] += np.tile([0.0, 0.7], 30)
    one = RangeVariance(THRESHOLD, 20)
    fed = [float(one.add(value).probability) for value in ranges]
    series = judge_variance(ranges[:, None], THRESHOLD, 20).probability[:, 0]
    np.testing.assert_allclose(fed, series, atol=1e-9)
    assert np.isnan(fed[:LEAST_DIFFERENCES]).all()


def test_range_variance_over_a_gap_takes_no_difference():
    """A tag that moved metres while nothing was heard has not jumped."""
    rng = np.random.default_rng(4)
    test = RangeVariance(THRESHOLD)
    for value in 3 + rng.normal(0, STD, 30):
        test.add(value)
    assert np.isnan(test.add(np.nan).probability)
    for value in 9 + rng.normal(0, STD, 5):
        verdict = test.add(value)
    assert not verdict.blocked
    test.reset()
    assert np.isnan(test.add(9.0).probability)


@pytest.mark.parametrize(('threshold', 'window'), [(0.0, 50), (np.nan, 50), (0.1, 1)])
def test_range_variance_without_threshold_or_window_raises(threshold, window):
    """A threshold that is not positive and a window without variance are errors."""
    with pytest.raises(GeometryError):
        RangeVariance(threshold, window)
    with pytest.raises(GeometryError):
        judge_variance(np.ones((5, 1)), threshold, window)
