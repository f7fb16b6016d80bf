from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control.fuzzy import corner_model, speed_model


def test_corner_model_is_lv_10() -> None:
    """lambda_g phi + lambda_ob arctan(1 / (d + e)) / 2, by hand."""
    expected = 0.8 * 0.5 + 2.0 * math.atan(1.0 / 0.25) / 2.0
    assert corner_model(0.5, 0.2, 0.8, 2.0, 0.05) == pytest.approx(expected)
    assert corner_model(0.5, 0.2, 1.0, 0.0, 0.05) == pytest.approx(0.5)  # nothing in the way


def test_corner_model_turns_to_the_freer_side_the_more_the_less_it_matters_which() -> None:
    apart = np.array([-1.0, -0.3, -0.01, 0.0, 0.01, 0.3, 1.0])
    turn = corner_model(0.0, apart, 1.0, 1.0, 0.05)
    assert (np.sign(turn) == [-1, -1, -1, 1, 1, 1, 1]).all()  # at 0 to the left, as table III does
    np.testing.assert_allclose(turn[:3], -turn[:3:-1])
    assert turn[3] > turn[4] > turn[5] > turn[6]
    assert np.abs(turn).max() < math.pi / 4


@pytest.mark.parametrize(
    ('target', 'obstacle', 'speed'),
    [(0.0, 3.0, 0.0), (0.25, 3.0, 0.2), (5.0, 3.0, 0.6), (5.0, 0.0, 0.08), (5.0, 0.5, 0.38)],
)
def test_speed_model_is_the_least_of_lv_11(target: float, obstacle: float, speed: float) -> None:
    assert speed_model(target, obstacle, 0.8, 0.6, 0.08, 0.6) == pytest.approx(speed)
