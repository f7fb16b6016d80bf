"""Whiteness: correlation of successive innovations of one anchor, and its bound."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.evaluation.whiteness import lag_one


def test_white_noise_is_inside_its_bound_at_nineteen_of_twenty():
    rng = np.random.default_rng(0)
    keys = ['a', 'b', 'b', 'c'] * 100
    found = [lag_one(rng.normal(size=400), keys) for _ in range(400)]
    # 95 % of 400, three standard deviations of the count (4.4) below and above.
    assert 367 <= sum(item.holds for item in found) <= 393
    assert found[0].pairs == 397
    assert found[0].bound == pytest.approx(1.96 / np.sqrt(397))


def test_correlation_is_that_of_the_series():
    rng = np.random.default_rng(1)
    values = [0.0]
    for _ in range(20_000):
        values.append(0.6 * values[-1] + rng.normal())
    found = lag_one(np.array(values), ['a'] * len(values))
    assert found.correlation == pytest.approx(0.6, abs=0.02)
    assert not found.holds


def test_biases_of_two_anchors_show_though_they_cancel():
    """One reads too long, the other too short: successive ones of all together would hide it."""
    rng = np.random.default_rng(2)
    values = rng.normal(size=1000) + np.tile([1.0, -1.0], 500)
    assert lag_one(values, ['a', 'b'] * 500).correlation > 0.4
    assert lag_one(values, ['a'] * 1000).correlation < -0.4


@pytest.mark.parametrize(('values', 'keys'), [([], []), ([1.0], ['a']), ([1.0, 2.0], ['a', 'b'])])
def test_no_pairs_no_correlation(values, keys):
    found = lag_one(np.array(values), keys)
    assert found.pairs == 0
    assert np.isnan(found.correlation)
    assert not found.holds
