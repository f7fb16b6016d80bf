"""Moving each range by its deviation gives the mean square that errors cause."""

import numpy as np
import pytest

from tablerunner.uwb.solvers.sigma_points import propagate

STD = np.array([[0.1, 0.3]])
USED = np.ones((1, 2), dtype=bool)


def test_propagate_linear_is_exact():
    """For a linear place the covariance is G R G'."""
    gain = np.array([[1.0, 2.0], [-0.5, 0.3]])
    found = propagate(lambda r: r @ gain.T, np.array([[3.0, 4.0]]), STD, USED)
    assert found[0] == pytest.approx(gain @ np.diag(STD[0] ** 2) @ gain.T)


def test_propagate_even_part_counts():
    """A place that moves the same way for either sign moves all the same: 3 E E'."""
    found = propagate(
        lambda r: np.column_stack([(r[:, 0] - 3) ** 2, r[:, 1]]), np.array([[3.0, 4.0]]), STD, USED
    )
    assert found[0] == pytest.approx(np.diag([3 * 0.1**4, 0.3**2]))


def test_propagate_without_a_place_on_one_side_takes_the_other():
    """Where a longer range has no place, the shorter one speaks for both."""
    found = propagate(lambda r: np.where(r > 4.0001, np.nan, r), np.array([[3.0, 4.0]]), STD, USED)
    assert found[0] == pytest.approx(np.diag(STD[0] ** 2))
