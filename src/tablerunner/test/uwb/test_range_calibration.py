"""Calibration finds bias and scale, and knows how well."""

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.errors import GeometryError
from tablerunner.uwb.range_calibration import fit_calibration

BIAS, SCALE = 0.23, 0.012


def raw(true, rng, std=0.05):
    return (1 + SCALE) * true + BIAS + rng.normal(0, std, len(true))


@pytest.mark.parametrize('robust', [True, False])
def test_fit_exact_line_is_found_and_undone(robust):
    """Exact ranges give bias and scale, and `apply` gives the true distances back."""
    true = np.linspace(1, 12, 30)
    found = fit_calibration(true, (1 + SCALE) * true + BIAS, robust=robust)
    assert (found.bias_m, found.scale) == pytest.approx((BIAS, SCALE), abs=1e-9)
    assert found.apply((1 + SCALE) * true + BIAS) == pytest.approx(true)
    assert found.scale_fitted


@pytest.mark.parametrize('robust', [True, False])
def test_fit_uncertainty_is_that_of_repeated_fits(robust):
    """Over many data sets, errors over the claimed covariance are chi-square distributed."""
    rng = np.random.default_rng(1)
    total, runs = 0.0, 400
    for _ in range(runs):
        true = rng.uniform(1, 12, 60)
        found = fit_calibration(true, raw(true, rng), robust=robust)
        error = np.array([found.bias_m - BIAS, found.scale - SCALE])
        total += error @ np.linalg.solve(found.covariance, error)
    low, high = chi2.ppf([0.001, 0.999], 2 * runs)
    # 60 residuals tell their own variance to 10 %, which lengthens the tails.
    assert low < total < 1.15 * high


def test_fit_blocked_ranges_hardly_move_the_robust_line():
    """One range in six too long by metres spoils the plain line, not the robust one."""
    rng = np.random.default_rng(2)
    true = rng.uniform(1, 12, 300)
    measured = raw(true, rng) + (rng.random(300) < 1 / 6) * rng.exponential(1.5, 300)
    plain, robust = (fit_calibration(true, measured, robust=flag) for flag in (False, True))
    at = np.array([2.0, 6.0, 10.0])
    wrong = [np.abs(fit.bias_m + fit.scale * at - BIAS - SCALE * at) for fit in (plain, robust)]
    assert wrong[0].max() > 0.15
    assert wrong[1].max() < 0.05


def test_fit_from_one_place_has_no_scale():
    """Ranges over half a metre tell a bias only, and it says so."""
    rng = np.random.default_rng(3)
    true = rng.uniform(4.0, 4.5, 100)
    found = fit_calibration(true, true + 0.3 + rng.normal(0, 0.05, 100))
    assert not found.scale_fitted
    assert found.scale == 0.0
    assert found.bias_m == pytest.approx(0.3, abs=0.02)
    assert found.deviation(4.0) == pytest.approx(0.005, rel=0.4)


def test_fit_deviation_is_least_amid_the_data():
    """The line is known best where the data are."""
    rng = np.random.default_rng(4)
    true = rng.uniform(2, 8, 100)
    found = fit_calibration(true, raw(true, rng))
    at = found.deviation([5.0, 2.0, 30.0])
    assert at[0] < at[1] < at[2]


@pytest.mark.parametrize(
    ('true', 'measured', 'words'),
    [
        ([1.0, 2.0], [1.0, 2.0], 'too few'),
        ([1.0, 2.0, np.nan, 4.0], [1.0, np.nan, 3.0, 4.0], 'too few'),
        ([1.0, 2.0, 3.0], [1.0, 2.0], 'do not match'),
        ([0.0, 2.0, 3.0], [1.0, 2.0, 3.0], 'not positive'),
    ],
)
def test_fit_of_what_cannot_be_fitted_raises(true, measured, words):
    """Too few pairs, shapes that differ and impossible distances are errors."""
    with pytest.raises(GeometryError, match=words):
        fit_calibration(true, measured)
