import numpy as np
import pytest

from tablerunner.estimation.particles.weights import effective_size, normalised


def test_weights_far_below_the_smallest_number_keep_their_ratio():
    found = normalised(np.array([-5000.0, -5000.0 + np.log(3.0)]))
    assert np.exp(found.log_weights) == pytest.approx([0.25, 0.75])
    assert found.log_sum == pytest.approx(-5000.0 + np.log(4.0))
    assert not found.recovered


def test_nan_counts_as_no_weight():
    found = normalised(np.array([np.nan, 0.0, 0.0]))
    assert np.exp(found.log_weights) == pytest.approx([0.0, 0.5, 0.5])
    assert not found.recovered


@pytest.mark.parametrize('weight', [-np.inf, np.nan])
def test_no_weight_at_all_is_said_and_all_count_alike(weight):
    found = normalised(np.full(4, weight))
    assert found.recovered
    assert np.exp(found.log_weights) == pytest.approx(np.full(4, 0.25))


def test_effective_size_is_what_equal_weights_would_be():
    """N for equal weights, one for a single one, 1 / sum of squares between."""
    assert effective_size(np.log(np.full(50, 0.02))) == pytest.approx(50.0)
    assert effective_size(np.array([0.0, -np.inf, -np.inf])) == pytest.approx(1.0)
    assert effective_size(np.log([0.5, 0.25, 0.25])) == pytest.approx(1.0 / 0.375)
