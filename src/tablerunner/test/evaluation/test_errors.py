"""Errors against hand-worked cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.evaluation.errors import compare
from tablerunner.evaluation.truth import Truth
from tablerunner.geometry.pose import Pose2

STAMPS = np.array([0, 100, 200, 300], dtype=np.int64) * 1_000_000
TRUTH = Truth.from_poses((int(stamp), Pose2(0.0, 0.0, 3.0), True) for stamp in STAMPS)


def test_compare_by_hand_gives_these_sizes() -> None:
    """Distances 0, 3-4-5, 1, 2: mean 2, RMSE sqrt(30 / 4), max 5, final 2."""
    poses = np.array([[0, 0, 3.0], [3, 4, 3.0], [0, -1, 3.0], [2, 0, 3.0]])
    summary = compare(STAMPS, poses, TRUTH).summary()
    assert summary.count == 4
    assert summary.mean == pytest.approx(2.0)
    assert summary.rmse == pytest.approx(math.sqrt(30.0 / 4.0))
    assert summary.max == pytest.approx(5.0)
    assert summary.final == pytest.approx(2.0)
    assert summary.heading_rmse == 0.0


def test_compare_heading_error_goes_the_short_way_round() -> None:
    poses = np.array([[0, 0, -3.0]] * 4)
    series = compare(STAMPS, poses, TRUTH)
    np.testing.assert_allclose(series.errors[:, 2], 2.0 * math.pi - 6.0)
    assert series.summary().heading_rmse == pytest.approx(2.0 * math.pi - 6.0)


def test_compare_does_not_align() -> None:
    """A path that is only shifted is wrong by the shift."""
    summary = compare(STAMPS, np.array([[0.5, 0, 3.0]] * 4), TRUTH).summary()
    assert summary.rmse == summary.mean == summary.max == pytest.approx(0.5)


def test_compare_times_without_truth_are_left_out() -> None:
    stamps = np.concatenate([STAMPS, [10**12]])
    covariances = np.arange(5 * 9, dtype=float).reshape(5, 3, 3)
    series = compare(stamps, np.ones((5, 3)), TRUTH, covariances)
    np.testing.assert_array_equal(series.stamps, STAMPS)
    np.testing.assert_array_equal(series.covariances, covariances[:4])


def test_compare_nothing_in_common_gives_no_figures() -> None:
    summary = compare(np.array([10**12]), np.ones((1, 3)), TRUTH).summary()
    assert summary.count == 0
    assert math.isnan(summary.rmse)
    assert math.isnan(summary.final)
