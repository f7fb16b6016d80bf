"""Least-squares fixes: exact on exact ranges, efficient on noisy ones, honest where open."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from tablerunner.errors import GeometryError
from tablerunner.uwb import FixState, gdop, solve_positions

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


def test_solve_single_epoch_equals_the_array():
    """One epoch, solved in plain floats, gives what it gives among many, to the nanometre."""
    rng = np.random.default_rng(8)
    position = rng.uniform(-5, 20, (300, 2))
    ranges = distances(position) + rng.normal(0, 0.3, (300, 4)) + rng.exponential(0.5, (300, 4))
    ranges[rng.random((300, 4)) < 0.1] = np.nan
    std = rng.uniform(0.05, 0.5, (300, 4))
    fix = solve_positions(ROOM, ranges, std, HEIGHT)
    for k in range(300):
        one = solve_positions(ROOM, ranges[k], std[k], HEIGHT)
        for name in ('state', 'used_mask'):
            assert getattr(one, name)[0].tolist() == getattr(fix, name)[k].tolist()
        for name in ('position', 'covariance', 'residual_rms', 'chi_square', 'gdop'):
            np.testing.assert_allclose(
                getattr(one, name)[0], getattr(fix, name)[k], rtol=1e-6, atol=1e-8
            )


def test_solve_across_chunks_equals_each_alone():
    """More epochs than one chunk holds come back complete and in order."""
    rng = np.random.default_rng(9)
    position = rng.uniform(1, 14, (20_000, 2))
    fix = solve_positions(ROOM, distances(position), 0.1, HEIGHT)
    assert fix.position == pytest.approx(position, abs=1e-6)
    assert len(fix) == 20_000


def test_solve_random_rooms_finds_the_lowest_minimum():
    """No start anywhere in a wide grid leads lower, with blocked ranges and odd layouts too."""
    rng = np.random.default_rng(10)
    axis = np.linspace(-10, 30, 61)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    for _ in range(60):
        count = int(rng.integers(3, 7))
        anchors = np.column_stack([rng.uniform(0, 20, (count, 2)), rng.uniform(1, 3, count)])
        position = rng.uniform(-5, 25, (3, 2))
        ranges = distances(position, anchors) + rng.normal(0, 0.1, (3, count))
        ranges += (rng.random((3, count)) < 0.15) * rng.exponential(1, (3, count))
        fix = solve_positions(anchors, ranges, 0.1, HEIGHT)
        reach = distances(grid, anchors)
        for k in np.flatnonzero(fix.solved):
            rough = grid[np.argmin(np.sum((reach - ranges[k]) ** 2, axis=1))]
            best = least_squares(
                lambda p, row=ranges[k], layout=anchors: (
                    (distances(p[None], layout)[0] - row) / 0.1
                ),
                rough,
            )
            assert fix.chi_square[k] <= 2 * best.cost * (1 + 1e-6) + 1e-6


CORRIDOR = np.array([[0, 0, 2], [10, 0.3, 2], [20, -0.2, 2.0]])


def test_solve_anchors_nearly_in_line_owns_up_to_the_other_side():
    """Where the side can be mistaken, the covariance covers both sides, or there is no fix."""
    rng = np.random.default_rng(11)
    truth = np.repeat([[7.0, 2.0]], 4000, axis=0)
    ranges = distances(truth, CORRIDOR) + rng.normal(0, 0.1, (4000, 3))
    fix = solve_positions(CORRIDOR, ranges, 0.1, HEIGHT)
    wrong = fix.position[:, 1] < 0
    assert 0.005 < np.mean(wrong[fix.solved]) < 0.3  # the case is worth the test
    error = (fix.position - truth)[fix.solved]
    nees = np.einsum('mi,mij,mj->m', error, np.linalg.inv(fix.covariance[fix.solved]), error)
    assert 1.5 < nees.mean() < 2.5  # 2 for a covariance that is right


def test_solve_side_that_ranges_cannot_tell_is_no_fix():
    """Anchors 10 cm off one line and ranges good to 10 cm leave the side open, and say so."""
    almost = np.array([[0, 0, 2], [10, 0.05, 2], [20, -0.05, 2.0]])
    ranges = distances(np.array([[7.0, 6.0], [7.0, 0.3]]), almost)
    fix = solve_positions(almost, ranges, 0.1, HEIGHT)
    assert fix.state[0] == FixState.AMBIGUOUS
    if fix.solved[1]:  # both sides of the line are as good as one place there
        assert fix.covariance[1, 1, 1] > 0.3**2


def test_solve_epoch_whose_anchors_are_in_line_is_no_fix():
    """Three of five anchors in one line leave the side open, though the five do not."""
    anchors = np.array([[0, 0, 2], [5, 0, 2], [10, 0, 2], [0, 8, 2], [10, 8, 2.0]])
    ranges = distances(np.array([[3.0, 4.0], [3.0, 4.0]]), anchors)
    ranges[0, 3:] = np.nan
    fix = solve_positions(anchors, ranges, 0.1, HEIGHT)
    assert fix.state.tolist() == [FixState.IN_LINE, FixState.SOLVED]
    assert np.isnan(fix.position[0]).all()


def test_solve_residual_test_has_its_size_and_sees_a_blocked_range():
    """Honest noise fails the chi-square test as often as it should; half a metre fails it."""
    rng = np.random.default_rng(12)
    position = rng.uniform(1, 14, (5000, 2))
    ranges = distances(position) + rng.normal(0, 0.1, (5000, 4))
    share = np.mean(~solve_positions(ROOM, ranges, 0.1, HEIGHT).consistent(0.05))
    assert share == pytest.approx(0.05, abs=0.012)
    ranges[:, 2] += 1.0
    assert np.mean(~solve_positions(ROOM, ranges, 0.1, HEIGHT).consistent(0.01)) > 0.95


def test_solve_three_ranges_have_one_to_spare_for_the_test():
    """With three ranges the test has one degree of freedom; with none to spare it has no say."""
    fix = solve_positions(ROOM, distances(np.array([[3.0, 4.0]])), 0.1, HEIGHT)
    assert fix.p_value[0] == pytest.approx(1.0)
    assert fix.excess[0] == 1.0


def test_solve_anchors_at_unequal_heights_is_exact():
    """Each anchor bridges its own height."""
    anchors = np.array([[0, 0, 0.3], [15, 0, 4.0], [15, 15, 2.25], [0, 15, 1.1]])
    position = np.array([[4.0, 11.0], [0.1, 0.2]])
    fix = solve_positions(anchors, distances(position, anchors), 0.1, HEIGHT)
    assert fix.position == pytest.approx(position, abs=1e-7)
