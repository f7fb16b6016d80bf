"""The line of the clear ranges is found among many that are blocked, and its errors are known."""

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.errors import GeometryError
from tablerunner.uwb.range_calibration import fit_calibration

BIAS, SCALE, STD = 0.12, -0.008, 0.08


def measured(rng, count, share):
    """Return true ranges, and raw ones of which a share is 0.2 to 1 m too long."""
    true = rng.uniform(2.0, 11.0, count)
    raw = (1.0 + SCALE) * true + BIAS + rng.normal(0.0, STD, count)
    blocked = rng.uniform(size=count) < share
    return true, raw + np.where(blocked, rng.uniform(0.2, 1.0, count), 0.0)


@pytest.mark.parametrize('share', [0.0, 0.2, 0.35])
def test_errors_are_as_large_as_the_covariance_says(share):
    """Over 200 data sets: errors over the covariance, and the noise of a clear range.

    A blocked range that is 0.2 m too long lies within the cut of three deviations and pulls a
    little: the mean may be a fifth above that of chi-square with two degrees of freedom.
    """
    rng = np.random.default_rng(11)
    squares, noise = [], []
    for _ in range(200):
        found = fit_calibration(*measured(rng, 400, share), blocked=True)
        error = np.array([found.bias_m - BIAS, found.scale - SCALE])
        squares.append(error @ np.linalg.solve(found.covariance, error))
        noise.append(found.residual_std_m)
    low, high = chi2.ppf([0.001, 0.999], 400) / 200
    assert low < np.mean(squares) < high * (1.2 if share else 1.0)
    assert np.mean(noise) == pytest.approx(STD, rel=0.04)


def test_biases_are_right_where_hubers_are_not():
    """A third of the ranges blocked: a centimetre against six and more, 20 seeds."""
    wrong = {True: [], False: []}
    for seed in range(20):
        true, raw = measured(np.random.default_rng(seed), 500, 0.33)
        for blocked, errors in wrong.items():
            found = fit_calibration(true, raw, blocked=blocked)
            middle = float(np.mean(true))
            errors.append(found.bias_m + found.scale * middle - BIAS - SCALE * middle)
    assert abs(np.mean(wrong[True])) < 0.01
    assert np.max(np.abs(wrong[True])) < 0.03
    assert np.min(wrong[False]) > 0.06


def test_share_that_was_left_out_is_told():
    rng = np.random.default_rng(3)
    true, raw = measured(rng, 2000, 0.0)
    raw[:600] += 1.0
    assert fit_calibration(true, raw, blocked=True).rejected == pytest.approx(0.3, abs=0.01)


def test_exact_ranges_among_blocked_ones_give_the_exact_line():
    true = np.linspace(2.0, 9.0, 41)
    raw = (1.0 + SCALE) * true + BIAS
    raw[::3] += 0.7
    found = fit_calibration(true, raw, blocked=True)
    assert found.bias_m == pytest.approx(BIAS, abs=1e-6)
    assert found.scale == pytest.approx(SCALE, abs=1e-6)


def test_one_distance_gives_a_bias_only():
    rng = np.random.default_rng(4)
    raw = 5.0 + BIAS + rng.normal(0.0, STD, 300) + (rng.uniform(size=300) < 0.3) * 0.6
    found = fit_calibration(np.full(300, 5.0), raw, blocked=True)
    assert not found.scale_fitted
    assert abs(found.bias_m - BIAS) < 3.0 * float(found.deviation(5.0))


def test_clear_ranges_of_one_distance_settle_no_line():
    """Most ranges of one distance, and a few far ones that are metres off."""
    true = np.r_[np.full(50, 4.0), np.linspace(8.0, 9.0, 5)]
    raw = true + np.r_[np.linspace(-0.01, 0.01, 50), 3.0, 5.0, 4.0, 7.0, 6.0]
    with pytest.raises(GeometryError, match='do not settle'):
        fit_calibration(true, raw, blocked=True)
