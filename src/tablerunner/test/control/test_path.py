from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.control import Path

SQUARE = Path(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.5]]))


@given(st.floats(0.0, SQUARE.length))
def test_project_of_point_on_path_returns_its_arc(arc: float) -> None:
    """A point of the path, looked for around where it is, is found there."""
    x, y = SQUARE.at(arc)
    found, distance = SQUARE.project(x, y, arc - 0.3, arc + 0.3)
    assert found == pytest.approx(arc, abs=1e-9)
    assert distance == pytest.approx(0.0, abs=1e-9)


def test_project_with_window_stays_on_its_leg() -> None:
    """Near the start of the loop its end is nearer, but lies outside the window."""
    assert SQUARE.project(0.0, 0.45)[0] == pytest.approx(SQUARE.length)
    assert SQUARE.project(0.0, 0.45, 0.0, 1.0) == pytest.approx((0.0, 0.45))


def test_path_drops_repeated_points() -> None:
    path = Path(np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]))
    assert path.length == 1.0
    assert len(path.points) == 2


def test_path_of_one_point_has_no_length() -> None:
    path = Path(np.array([[1.0, 2.0]]))
    assert path.length == 0.0
    assert path.project(1.0, 3.0) == (0.0, 1.0)
    assert path.resampled(0.1).shape == (1, 2)


@pytest.mark.parametrize('points', [np.empty((0, 2)), np.array([[0.0, np.nan]])])
def test_path_without_finite_points_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match='finite'):
        Path(points)


def test_resampled_path_keeps_corners_and_length() -> None:
    points = SQUARE.resampled(0.1)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.max() <= 0.1 + 1e-9
    assert steps.sum() == pytest.approx(SQUARE.length)
