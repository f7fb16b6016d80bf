"""Each resampling scheme against its distribution."""

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.estimation.particles.resampling import (
    RESAMPLERS,
    multinomial,
    residual,
    systematic,
)

WEIGHTS = np.array([0.5, 0.3, 0.1, 0.07, 0.03])
DRAWS, COUNT = 4000, 17


def counts_of(resample, weights=WEIGHTS, count=COUNT, draws=DRAWS, seed=1):
    rng = np.random.default_rng(seed)
    rows = [resample(weights, count, rng) for _ in range(draws)]
    assert all(len(row) == count for row in rows)
    return np.array([np.bincount(row, minlength=len(weights)) for row in rows])


@pytest.mark.parametrize('name', list(RESAMPLERS))
def test_every_scheme_gives_each_particle_its_share(name):
    """Mean count n w; its deviation over the draws is at most that of a multinomial."""
    mean = counts_of(RESAMPLERS[name]).mean(axis=0)
    deviation = np.sqrt(COUNT * WEIGHTS * (1.0 - WEIGHTS) / DRAWS)
    assert np.all(np.abs(mean - COUNT * WEIGHTS) < 4.0 * deviation)


def test_multinomial_counts_are_multinomial():
    """Chi-square over all draws, and the variances n w (1 - w) themselves."""
    counts = counts_of(multinomial)
    total = counts.sum(axis=0)
    expected = DRAWS * COUNT * WEIGHTS
    assert np.sum((total - expected) ** 2 / expected) < chi2.ppf(0.9999, len(WEIGHTS) - 1)
    # The relative deviation of a variance of 4000 draws is 2-3 %.
    assert counts.var(axis=0) == pytest.approx(COUNT * WEIGHTS * (1.0 - WEIGHTS), rel=0.12)


def test_systematic_counts_are_the_floor_or_the_ceiling():
    counts = counts_of(systematic)
    assert np.all(counts >= np.floor(COUNT * WEIGHTS))
    assert np.all(counts <= np.ceil(COUNT * WEIGHTS))


def test_residual_draws_only_what_is_left_over():
    """The whole part of n w is certain; what is left is multinomial (chi-square)."""
    counts = counts_of(residual)
    whole = np.floor(COUNT * WEIGHTS)
    assert np.all(counts >= whole)
    left = COUNT * WEIGHTS - whole
    total, expected = (counts - whole).sum(axis=0), DRAWS * left
    assert np.sum((total - expected) ** 2 / expected) < chi2.ppf(0.9999, len(WEIGHTS) - 1)
    free = left.sum()
    share = left / free
    assert counts.var(axis=0) == pytest.approx(free * share * (1.0 - share), rel=0.12, abs=0.01)


@pytest.mark.parametrize('resample', [systematic, residual])
def test_weights_that_divide_evenly_leave_nothing_to_chance(resample):
    """0.1 * 10 is below one in binary: no particle may lose its place to that."""
    for weights, expected in (
        (np.full(10, 0.1), np.ones(10)),
        (np.array([0.4, 0.0, 0.6]), np.array([2, 0, 3])),
    ):
        counts = counts_of(resample, weights, int(expected.sum()), draws=50)
        assert np.array_equal(counts, np.tile(expected, (50, 1)))


@pytest.mark.parametrize('name', list(RESAMPLERS))
def test_a_particle_without_weight_never_goes_on(name):
    weights = np.array([0.0, 0.6, 0.0, 0.4, 0.0])
    counts = counts_of(RESAMPLERS[name], weights, draws=500)
    assert not counts[:, weights == 0.0].any()


@pytest.mark.parametrize('name', list(RESAMPLERS))
def test_one_particle_and_other_counts(name):
    """N = 1, more and fewer particles than before."""
    rng = np.random.default_rng(0)
    assert RESAMPLERS[name](np.array([1.0]), 1, rng).tolist() == [0]
    assert len(RESAMPLERS[name](WEIGHTS, 3, rng)) == 3
    assert len(RESAMPLERS[name](WEIGHTS, 1000, rng)) == 1000
