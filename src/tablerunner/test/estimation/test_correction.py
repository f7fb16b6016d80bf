"""Corrections by one number against those of any size, alone and many at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.estimation.correction import correct, correct_by_one, correct_state, expect
from tablerunner.types import Estimate

SIZE = 5


def draw(rng, count):
    mixed = rng.normal(size=(count, SIZE, SIZE))
    covariance = mixed @ mixed.transpose(0, 2, 1)
    mean = rng.normal(size=(count, SIZE))
    return mean, covariance, rng.normal(size=count), rng.normal(size=(count, SIZE))


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 10.0))
def test_correct_by_one_equals_the_general_correction(seed, noise):
    rng = np.random.default_rng(seed)
    mean, covariance, innovation, slope = draw(rng, 4)
    many = correct_by_one(mean, covariance, innovation, slope, noise)
    for index in range(4):
        seen = expect(
            covariance[index],
            innovation[index : index + 1],
            slope[index][None],
            np.array([[noise]]),
        )
        expected = correct(Estimate(0, mean[index], covariance[index]), seen, 1)
        one = correct_by_one(
            mean[index], covariance[index], innovation[index], slope[index], noise
        )
        for found in (one.mean, many.mean[index]):
            assert found == pytest.approx(expected.mean, abs=1e-9)
        for found in (one.covariance, many.covariance[index]):
            assert found == pytest.approx(expected.covariance, abs=1e-9)
        assert one.spread == pytest.approx(seen.spread[0, 0])
        assert many.spread[index] == pytest.approx(seen.spread[0, 0])


def test_correct_state_equals_a_slope_of_one():
    rng = np.random.default_rng(2)
    mean, covariance, innovation, _ = draw(rng, 6)
    noise = rng.uniform(0.1, 1.0, 6)
    slope = np.zeros(SIZE)
    slope[3] = 1.0
    found = correct_state(mean, covariance, innovation, 3, noise)
    expected = correct_by_one(mean, covariance, innovation, slope, noise)
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, abs=1e-12)


def test_states_that_are_not_used_stay_as_they_are():
    """Also where the innovation is not a number."""
    rng = np.random.default_rng(3)
    mean, covariance, innovation, slope = draw(rng, 3)
    innovation[1] = np.nan
    used = np.array([True, False, True])
    after = correct_by_one(mean, covariance, innovation, slope, 0.1, used)
    assert after.mean[1] == pytest.approx(mean[1], abs=1e-15)
    assert after.covariance[1] == pytest.approx(covariance[1], abs=1e-15)
    assert not np.allclose(after.mean[0], mean[0])
    assert np.all(np.isfinite(after.mean))
