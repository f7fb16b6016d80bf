"""Linear least squares: exact on exact ranges, the textbook's on noisy ones."""

import numpy as np
import pytest

from tablerunner.uwb import solve

ROOM = np.array([[0, 0, 2.25], [15, 0, 2.0], [15, 15, 2.25], [0, 15, 3.0]])
HEIGHT = 1.1


def distances(position):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - ROOM[None], axis=-1)


def test_linear_solves_the_equations_of_the_paper():
    """The position is that of the overdetermined system in x, y and r (Liu 3-5)."""
    rng = np.random.default_rng(1)
    ranges = distances(rng.uniform(1, 14, (20, 2))) + rng.normal(0, 0.3, (20, 4))
    fix = solve('linear', ROOM, ranges, 0.3, HEIGHT)
    plane2 = ranges**2 - (ROOM[:, 2] - HEIGHT) ** 2
    matrix = np.column_stack([-2 * ROOM[:, :2], np.ones(4)])
    for k in range(20):
        right = plane2[k] - np.sum(ROOM[:, :2] ** 2, axis=1)
        expected = np.linalg.lstsq(matrix, right, rcond=None)[0][:2]
        assert fix.position[k] == pytest.approx(expected, abs=1e-9)


def test_linear_covariance_is_that_of_the_scatter():
    """The covariance predicts the scatter of many fixes at one place."""
    rng = np.random.default_rng(2)
    place = np.array([[4.0, 12.0]])
    std = np.array([0.05, 0.1, 0.2, 0.05])
    ranges = distances(place) + rng.normal(0, std, (20_000, 4))
    fix = solve('linear', ROOM, ranges, std, HEIGHT)
    assert np.cov(fix.position.T) == pytest.approx(fix.covariance[0], rel=0.06, abs=2e-4)


def test_linear_far_from_the_origin_keeps_its_digits():
    """A map whose origin is 100 km away costs less than a micrometre."""
    shift = np.array([100_000.0, -50_000.0, 0.0])
    place = np.array([[3.0, 4.0]])
    fix = solve('linear', ROOM + shift, distances(place), 0.1, HEIGHT)
    assert fix.position - shift[:2] == pytest.approx(place, abs=1e-6)
