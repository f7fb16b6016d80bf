"""Residual weighting: subsets that agree with themselves outvote the others."""

from itertools import combinations

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb import solve

ROOM = np.array([[0, 0, 1.1], [15, 1, 1.1], [14, 15, 1.1], [1, 14, 1.1], [7, 16, 1.1]])
HEIGHT = 1.1


def distances(position):
    return np.linalg.norm(position[:, None, :] - ROOM[None, :, :2], axis=-1)


def test_residual_weighted_is_the_weighted_mean_of_all_subsets():
    """The position is that of a plain loop over subsets."""
    rng = np.random.default_rng(1)
    ranges = distances(rng.uniform(1, 14, (1, 2))) + rng.normal(0, 0.3, (1, 5))
    total, weights = np.zeros(2), 0.0
    for size in (3, 4, 5):
        for subset in combinations(range(5), size):
            few, row = ROOM[list(subset), :2], ranges[0, list(subset)]
            matrix = np.column_stack([-2 * few, np.ones(size)])
            place = np.linalg.lstsq(matrix, row**2 - np.sum(few**2, axis=1), rcond=None)[0][:2]
            weight = 1 / np.mean((np.linalg.norm(place - few, axis=1) - row) ** 2)
            total, weights = total + weight * place, weights + weight
    fix = solve('residual_weighted', ROOM, ranges, 0.3, HEIGHT)
    assert fix.position[0] == pytest.approx(total / weights, abs=1e-9)


def test_residual_weighted_one_blocked_range_hurts_less_than_plain_least_squares():
    """With one range two metres too long, errors are well below half of the plain solution's."""
    rng = np.random.default_rng(2)
    position = rng.uniform(3, 12, (400, 2))
    ranges = distances(position) + rng.normal(0, 0.03, (400, 5))
    ranges[np.arange(400), rng.integers(0, 5, 400)] += 2.0
    error = {
        name: np.linalg.norm(solve(name, ROOM, ranges, 0.05, HEIGHT).position - position, axis=1)
        for name in ('residual_weighted', 'linear')
    }
    assert error['residual_weighted'].mean() < 0.4 * error['linear'].mean()


def test_residual_weighted_too_many_anchors_is_refused():
    """Subsets double with each anchor: beyond ten it is refused."""
    anchors = np.random.default_rng(3).uniform(0, 20, (11, 3))
    with pytest.raises(GeometryError, match='10 anchors at most'):
        solve('residual_weighted', anchors, np.full((1, 11), 5.0), 0.1, HEIGHT)
