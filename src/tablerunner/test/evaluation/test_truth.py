"""Interpolation of the truth."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.evaluation.truth import Truth
from tablerunner.geometry.pose import Pose2

DAY = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def make(*rows: tuple[float, float, float, float], known: bool = True) -> Truth:
    """Return a truth of (second, x, y, heading)."""
    return Truth.from_poses(
        (DAY + round(time * SECOND), Pose2(x, y, heading), known) for time, x, y, heading in rows
    )


def test_truth_between_two_poses_is_their_weighted_mean() -> None:
    truth = make((0.0, 1.0, 2.0, 0.2), (0.4, 3.0, 1.0, 0.6))
    positions, headings = truth.at(np.array([DAY + SECOND // 10]))
    np.testing.assert_allclose(positions, [[1.5, 1.75]], atol=1e-9)
    np.testing.assert_allclose(headings, [0.3], atol=1e-9)


def test_truth_heading_goes_the_short_way_round() -> None:
    truth = make((0.0, 0.0, 0.0, 3.1), (0.2, 0.0, 0.0, -3.1))
    _, headings = truth.at(np.array([DAY + SECOND // 10]))
    assert abs(abs(headings[0]) - math.pi) < 1e-9


def test_truth_outside_and_in_gaps_is_unknown() -> None:
    truth = make((0.0, 0, 0, 0), (0.1, 1, 0, 0), (2.0, 2, 0, 0), (2.1, 3, 0, 0))
    times = [-0.1, 0.0, 0.05, 0.1, 1.0, 2.0, 2.1, 2.2]
    positions, _ = truth.at(DAY + (np.array(times) * SECOND).astype(np.int64))
    known = np.isfinite(positions[:, 0])
    assert known.tolist() == [False, True, True, True, False, True, True, False]


def test_truth_unknown_heading_stays_unknown() -> None:
    positions, headings = make((0.0, 1, 1, 0), (0.1, 2, 1, 0), known=False).at(np.array([DAY]))
    assert np.isfinite(positions).all()
    assert np.isnan(headings).all()


def test_truth_empty_or_single_pose_works() -> None:
    positions, _ = make().at(np.array([DAY]))
    assert np.isnan(positions).all()
    positions, _ = make((0.0, 1.0, 2.0, 0.0)).at(np.array([DAY - 1, DAY, DAY + 1]))
    np.testing.assert_array_equal(positions, [[np.nan] * 2, [1.0, 2.0], [np.nan] * 2])


def test_truth_unsorted_and_repeated_poses_are_put_in_order() -> None:
    truth = make((0.2, 2, 0, 0), (0.0, 0, 0, 0), (0.2, 4, 0, 0))
    assert len(truth) == 2
    positions, _ = truth.at(np.array([DAY + SECOND // 10]))
    np.testing.assert_allclose(positions, [[2.0, 0.0]], atol=1e-9)


@given(st.lists(st.integers(0, 40), min_size=2, max_size=20, unique=True), st.floats(0.0, 1.0))
def test_truth_of_steady_motion_is_exact_everywhere(steps: list[int], share: float) -> None:
    """On a straight line at steady speed interpolation has no error, whatever the sampling."""
    ordered = sorted(steps)
    truth = make(*((0.01 * step, 0.03 * step, -0.02 * step, 0.005 * step) for step in ordered))
    span = ordered[-1] - ordered[0]
    offset = round((ordered[0] + share * span) * 0.01 * SECOND)
    positions, headings = truth.at(np.array([DAY + offset]))
    at = offset / SECOND / 0.01
    np.testing.assert_allclose(positions, [[0.03 * at, -0.02 * at]], atol=1e-6)
    np.testing.assert_allclose(headings, [0.005 * at], atol=1e-6)
