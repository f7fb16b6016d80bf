import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.estimation.particles.kld import enough, occupied


@pytest.mark.parametrize('bins', [5, 30, 400])
def test_enough_is_the_chi_square_quantile(bins):
    """2 n e = chi-square; Wilson and Hilferty's approximation is good to a percent here."""
    expected = chi2.ppf(0.99, bins - 1) / (2.0 * 0.05)
    assert enough(bins, 0.05, 0.99) == pytest.approx(expected, rel=0.01)


def test_so_many_particles_keep_the_distance():
    """Of histograms drawn with that number, 1 - d are within e of the true one (3 deviations)."""
    rng = np.random.default_rng(3)
    bins, error, confidence, draws = 20, 0.05, 0.9, 4000
    true = rng.dirichlet(np.full(bins, 5.0))
    count = enough(bins, error, confidence)
    drawn = rng.multinomial(count, true, size=draws) / count
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = np.where(drawn > 0.0, drawn * np.log(drawn / true), 0.0).sum(axis=1)
    kept = float(np.mean(distance <= error))
    assert kept == pytest.approx(confidence, abs=0.03)


def test_one_bin_needs_one_particle():
    assert enough(1, 0.05, 0.99) == 1


def test_occupied_bins_are_counted_once_also_below_zero():
    places = np.array([[0.1, 0.1], [0.2, 0.4], [-0.1, 0.1], [0.1, -0.6], [7.0, 9.0]])
    assert occupied(places, (0.5, 0.5)) == 4


def test_a_uniform_cloud_fills_the_grid():
    places = np.random.default_rng(0).random((20000, 3)) * (4.0, 3.0, 2.0)
    assert occupied(places, (1.0, 1.0, 0.5)) == 4 * 3 * 4
