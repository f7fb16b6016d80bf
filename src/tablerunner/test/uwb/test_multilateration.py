"""Least-squares fixes: exact on exact ranges, efficient on noisy ones, honest where open."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from tablerunner.errors import GeometryError
from tablerunner.uwb import gdop, solve_positions

ROOM = np.array([[0, 0, 2.25], [15, 0, 2.25], [15, 15, 2.25], [0, 15, 2.25]], dtype=float)
HEIGHT = 1.1


def distances(position, anchors=ROOM):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - anchors[None], axis=-1)


@given(st.floats(0.5, 14.5), st.floats(0.5, 14.5), st.integers(-1, 3))
def test_solve_exact_ranges_gives_the_position(x, y, missing):
    """Three or four exact ranges give the place to a micrometre."""
    position = np.array([[x, y]])
    ranges = distances(position)
    if missing >= 0:
        ranges[0, missing] = np.nan
    fix = solve_positions(ROOM, ranges, 0.1, HEIGHT)
    assert fix.position == pytest.approx(position, abs=1e-6)
    assert fix.used[0] == 4 - (missing >= 0)


def test_solve_noisy_ranges_agrees_with_scipy():
    """Each epoch ends in the minimum that scipy finds on its own."""
    rng = np.random.default_rng(5)
    position = rng.uniform(0.5, 14.5, (40, 2))
    std = rng.uniform(0.05, 0.3, (40, 4))
    ranges = distances(position) + rng.normal(0, std)
    fix = solve_positions(ROOM, ranges, std, HEIGHT)
    for k in range(40):
        reference = least_squares(
            lambda p, k=k: (distances(p[None])[0] - ranges[k]) / std[k], [7.5, 7.5], xtol=1e-12
        )
        assert fix.position[k] == pytest.approx(reference.x, abs=1e-5)


def test_solve_noisy_ranges_has_consistent_covariance():
    """The mean normalised squared error over many fixes is chi-square distributed."""
    rng = np.random.default_rng(6)
    runs = 4000
    position = rng.uniform(1, 14, (runs, 2))
    fix = solve_positions(ROOM, distances(position) + rng.normal(0, 0.1, (runs, 4)), 0.1, HEIGHT)
    error = fix.position - position
    nees = np.einsum('mi,mij,mj->', error, np.linalg.inv(fix.covariance), error)
    low, high = chi2.ppf([0.001, 0.999], 2 * runs)
    # The linearised covariance is a few percent too small near the walls: allow 3 %.
    assert low < nees < 1.03 * high


def test_solve_two_ranges_leaves_the_position_open():
    """An epoch with two ranges is NaN; its neighbours are not disturbed."""
    position = np.array([[3.0, 4.0], [5.0, 6.0]])
    ranges = distances(position)
    ranges[0, :2] = np.nan
    fix = solve_positions(ROOM, ranges, 0.1, HEIGHT)
    assert np.all(np.isnan(fix.position[0]))
    assert np.all(np.isnan(fix.covariance[0]))
    assert fix.position[1] == pytest.approx(position[1], abs=1e-6)


@pytest.mark.parametrize(
    ('anchors', 'words'),
    [
        (ROOM[:2], '2 anchors are too few'),
        (np.array([[0, 0, 2], [5, 0, 2], [10, 0, 2.0]]), 'in one line'),
        (np.array([[1, 1, 2], [1, 1, 2], [1, 1, 2.0]]), 'in one line'),
    ],
)
def test_solve_hopeless_anchors_raises(anchors, words):
    """Too few, collinear or coincident anchors are an error, not a wrong place."""
    with pytest.raises(GeometryError, match=words):
        solve_positions(anchors, np.full((1, len(anchors)), 3.0), 0.1, HEIGHT)


def test_gdop_predicts_the_scatter_of_fixes():
    """GDOP times range noise is the RMS error of simulated fixes."""
    rng = np.random.default_rng(7)
    place = np.array([[3.0, 9.0]])
    fixes = solve_positions(
        ROOM, distances(np.repeat(place, 5000, 0)) + rng.normal(0, 0.05, (5000, 4)), 0.05, HEIGHT
    )
    scatter = np.sqrt(np.mean(np.sum((fixes.position - place) ** 2, axis=1)))
    assert scatter == pytest.approx(0.05 * gdop(ROOM, place, HEIGHT)[0], rel=0.04)
