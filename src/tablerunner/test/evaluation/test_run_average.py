"""Shares of steps inside the bounds, against hand-worked cases and drawn errors."""

import math

import numpy as np
import pytest

from tablerunner.evaluation.run_average import run_average


def test_means_and_bounds_by_hand():
    """Two runs of two dimensions: four degrees; tables give 0.4844 and 11.1433."""
    average = run_average(np.array([[2.0, 4.0, math.nan], [6.0, math.nan, math.nan]]), 2)
    np.testing.assert_allclose(average.means, [2.0, 2.0, math.nan])
    np.testing.assert_allclose(average.low[:2], [0.484419 / 4, 0.050636 / 2], rtol=1e-4)
    np.testing.assert_allclose(average.high[:2], [11.143287 / 4, 7.377759 / 2], rtol=1e-4)
    assert average.mean == pytest.approx(2.0)
    assert average.inside == 1.0


def test_steps_without_any_value_are_not_counted():
    average = run_average(np.array([[math.nan, 100.0]]), 1)
    assert average.inside == 0.0
    assert math.isnan(run_average(np.full((2, 3), math.nan), 3).inside)


def test_dimensions_may_differ_from_value_to_value():
    average = run_average(np.array([[2.0], [9.0]]), np.array([[2.0], [1.0]]))
    assert average.means[0] == pytest.approx(11.0 / 3.0)


def test_drawn_errors_are_inside_at_95_of_100_steps():
    """4000 independent steps: deviation of the share 0.34 %; a variance off by half: far fewer."""
    draws = np.random.default_rng(1).chisquare(3, (60, 4000))
    assert run_average(draws, 3).inside == pytest.approx(0.95, abs=0.011)
    assert run_average(1.5 * draws, 3).inside < 0.3
    assert run_average(draws / 1.5, 3).inside < 0.3
