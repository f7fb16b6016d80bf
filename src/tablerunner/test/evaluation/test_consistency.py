"""NEES and NIS against hand-worked cases, published bounds and drawn errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.evaluation.consistency import (
    chi_square_bounds,
    consistency,
    nees,
    summarize_innovations,
)
from tablerunner.types import Innovation


def test_chi_square_bounds_are_those_of_the_tables() -> None:
    """Standard tables: 2 degrees 0.0506 and 7.378, 100 degrees 74.22 and 129.56."""
    assert chi_square_bounds(2) == pytest.approx((0.050636, 7.377759), rel=1e-4)
    assert chi_square_bounds(100) == pytest.approx((74.2219, 129.5612), rel=1e-5)
    low, high = chi_square_bounds(3, 0.9)
    assert (low, high) == pytest.approx((0.351846, 7.814728), rel=1e-4)


def test_nees_by_hand() -> None:
    """(1, 2) with variances 4 and 1: 1/4 + 4; with correlation by the inverse worked by hand."""
    errors = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 1.0]])
    covariances = np.array(
        [[[4.0, 0.0], [0.0, 1.0]], [[2.0, 1.0], [1.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]]
    )
    values = nees(errors, covariances)
    # The inverse of [[2, 1], [1, 1]] is [[1, -1], [-1, 2]]: 1 - 4 + 8.
    np.testing.assert_allclose(values[:2], [4.25, 5.0])
    assert math.isnan(values[2])


def test_consistency_of_right_and_of_wrong_covariances() -> None:
    """Errors drawn from their covariance hold in about 95 of 100 runs; half or double never."""
    held = 0
    for seed in range(100):
        random = np.random.default_rng(seed)
        errors = random.normal(size=(400, 2)) * [0.5, 2.0]
        covariance = np.broadcast_to(np.diag([0.25, 4.0]), (400, 2, 2))
        held += consistency(nees(errors, covariance), [2] * 400).holds
        assert not consistency(nees(errors, 0.5 * covariance), [2] * 400).holds
        assert not consistency(nees(errors, 2.0 * covariance), [2] * 400).holds
    assert held >= 88


def test_consistency_of_nothing_has_no_figures() -> None:
    judged = consistency([math.nan], [2])
    assert judged.count == 0
    assert math.isnan(judged.mean)
    assert not judged.holds


def test_summarize_innovations_by_hand() -> None:
    def item(source: str, accepted: bool, nis: float, size: int = 1) -> Innovation:
        return Innovation(1, source, '', accepted, '', np.zeros(size), np.eye(size), nis, 9.0)

    found = summarize_innovations(
        [
            item('uwb/ranges', True, 0.5),
            item('uwb/ranges', True, 1.5),
            item('uwb/ranges', True, 4.0),
            item('uwb/ranges', False, 400.0),
            item('camera/pose', True, 6.0, 3),
        ]
    )
    assert list(found) == ['camera/pose', 'uwb/ranges']
    assert found['uwb/ranges'].count == 4
    assert found['uwb/ranges'].accepted == 0.75
    assert found['uwb/ranges'].nis.mean == pytest.approx(2.0)
    assert found['camera/pose'].nis.mean == pytest.approx(2.0)
    assert found['camera/pose'].nis.dimensions == 3
