"""The signal test agrees with the ranging's own curve, for arrays too."""

import numpy as np
import pytest

from tablerunner.uwb import ranging
from tablerunner.uwb.nlos import judge_signal


def test_judge_signal_is_the_curve_of_ranging():
    """Each element has the probability that `ranging.nlos_probability` gives it."""
    first = np.array([[-82.0, -88.0], [-95.0, np.nan]])
    verdict = judge_signal(-80.0, first, 8.0, 1.5)
    expected = [
        [ranging.nlos_probability(-80.0, value, 8.0, 1.5) for value in row] for row in first
    ]
    assert verdict.probability == pytest.approx(np.array(expected), nan_ok=True)
    assert verdict.blocked.tolist() == [[False, False], [True, False]]


def test_judge_signal_threshold_decides():
    """A higher threshold calls fewer ranges blocked."""
    first = np.array([-87.0, -88.5, -89.0, -92.0])
    few = judge_signal(-80.0, first, threshold=0.9).blocked
    assert judge_signal(-80.0, first, threshold=0.1).blocked.sum() > few.sum() == 1


def test_judge_signal_infinite_power_has_no_say():
    """No first path at all, given as minus infinity, is not known rather than certain."""
    assert np.isnan(judge_signal(-80.0, -np.inf).probability)
