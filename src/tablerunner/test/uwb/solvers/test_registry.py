"""What holds for every solver: exact on exact ranges, and never silently wrong."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.errors import ConfigError, CovarianceError, GeometryError
from tablerunner.uwb import SOLVERS, FixState, solve

ROOM = np.array([[0, 0, 2.25], [15, 0, 2.25], [15, 15, 2.25], [0, 15, 2.25]])
HEIGHT = 1.1
NAMES = sorted(SOLVERS)

coordinate = st.floats(-20.0, 20.0)
height = st.floats(0.5, 4.0)


def distances(position, anchors=ROOM):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - anchors[None], axis=-1)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('missing', [None, 0, 1, 2, 3])
def test_solver_exact_ranges_gives_the_position(name, missing):
    """Every solver is exact on exact ranges of any three or four anchors."""
    position = np.random.default_rng(1).uniform(1, 14, (50, 2))
    ranges = distances(position)
    if missing is not None:
        ranges[:, missing] = np.nan
    fix = solve(name, ROOM, ranges, 0.1, HEIGHT)
    assert np.all(fix.solved)
    assert fix.position == pytest.approx(position, abs=1e-6)
    assert np.all(fix.used >= 2)
    assert not (missing is not None and fix.used_mask[:, missing].any())
    assert np.all(np.linalg.eigvalsh(fix.covariance) > 0)


@pytest.mark.parametrize('name', NAMES)
def test_solver_one_epoch_equals_the_same_among_many(name):
    """An epoch's answer does not depend on its neighbours."""
    rng = np.random.default_rng(2)
    ranges = distances(rng.uniform(0, 15, (30, 2))) + rng.normal(0, 0.2, (30, 4))
    ranges[rng.random(ranges.shape) < 0.15] = np.nan
    fix = solve(name, ROOM, ranges, 0.2, HEIGHT)
    for k in range(30):
        one = solve(name, ROOM, ranges[k], 0.2, HEIGHT)
        assert one.state[0] == fix.state[k]
        np.testing.assert_allclose(one.position[0], fix.position[k], atol=1e-8)
        np.testing.assert_allclose(one.covariance[0], fix.covariance[k], atol=1e-8)


@pytest.mark.parametrize('name', NAMES)
def test_solver_covariance_is_consistent_with_its_errors(name):
    """Errors of many fixes, normalised by their own covariances, have the mean square of 2."""
    rng = np.random.default_rng(4)
    position = rng.uniform(1, 14, (4000, 2))
    fix = solve(name, ROOM, distances(position) + rng.normal(0, 0.1, (4000, 4)), 0.1, HEIGHT)
    assert fix.solved.mean() > 0.999
    error = (fix.position - position)[fix.solved]
    nees = np.einsum('mi,mij,mj->m', error, np.linalg.inv(fix.covariance[fix.solved]), error)
    # A standard error of the mean of 0.03. The point of two circles is chosen for its agreement
    # with the others, so that it errs less than two ranges alone; votes have heavy tails that the
    # Cramer-Rao bound holds, at the price of being too shy on average.
    shy = {'hyperbolic': (1.3, 1.9), 'residual_weighted': (0.9, 1.9), 'centroid': (1.7, 2.4)}
    low, high = shy.get(name, (1.85, 2.4))
    assert low < nees.mean() < high


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('bad', [np.nan, -3.0, 0.0, np.inf, -np.inf, 1e6, 1e300])
def test_solver_impossible_range_is_left_out(name, bad):
    """A range that no radio measures is as good as missing, and said not to be used."""
    position = np.array([[4.0, 6.0]])
    ranges = distances(position)
    ranges[0, 1] = bad
    fix = solve(name, ROOM, ranges, 0.1, HEIGHT)
    assert not fix.used_mask[0, 1]
    assert fix.position == pytest.approx(position, abs=1e-6)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('left', [(), (0,), (1, 2)])
def test_solver_too_few_ranges_is_no_position(name, left):
    """None, one or two ranges leave NaN and a reason; the next epoch is solved all the same."""
    ranges = distances(np.array([[4.0, 6.0], [5.0, 5.0]]))
    ranges[0, [j for j in range(4) if j not in left]] = np.nan
    fix = solve(name, ROOM, ranges, 0.1, HEIGHT)
    assert fix.state[0] in (FixState.TOO_FEW, FixState.AMBIGUOUS)
    assert np.isnan(fix.position[0]).all()
    assert np.isnan(fix.covariance[0]).all()
    assert fix.solved[1]


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize(
    ('anchors', 'words'),
    [
        (ROOM[:2], '2 anchors are too few'),
        (ROOM[:0], '0 anchors are too few'),
        (np.array([[0, 0, 2], [5, 0, 2], [10, 0, 2.0]]), 'in one line'),
        (np.array([[0, 0, 2], [5, 5, 3], [10, 10, 2.0]]), 'in one line'),
        (np.array([[1, 1, 2], [1, 1, 2], [1, 1, 2.0]]), 'in one line'),
        (np.array([[1, 1, 2], [1, 1, 3], [4, 4, 2.0]]), 'in one line'),
        (np.array([[0, 0, 2], [5, 0, 2], [np.nan, 5, 2.0]]), 'not finite'),
        (ROOM[:, :2], r'\(n, 3\)'),
    ],
)
def test_solver_hopeless_anchors_raise(name, anchors, words):
    """Too few, collinear, coincident or unknown anchors are an error."""
    with pytest.raises(GeometryError, match=words):
        solve(name, anchors, np.full((1, len(anchors)), 3.0), 0.1, HEIGHT)


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('std', [0.0, -0.1, np.nan, np.inf])
def test_solver_impossible_deviation_raises(name, std):
    """A standard deviation that is none is an error."""
    with pytest.raises(CovarianceError, match='not positive'):
        solve(name, ROOM, distances(np.array([[4.0, 6.0]])), std, HEIGHT)


@pytest.mark.parametrize('name', NAMES)
def test_solver_coincident_anchors_among_good_ones_do_no_harm(name):
    """Two anchors on one spot are one more range to it; only they and one other: no side."""
    anchors = np.vstack([ROOM, ROOM[:1]])
    position = np.array([[4.0, 6.0], [4.0, 6.0]])
    ranges = distances(position, anchors)
    ranges[1, [1, 3]] = np.nan  # leaves anchors 0, 2 and 0 again
    fix = solve(name, anchors, ranges, 0.1, HEIGHT)
    assert fix.position[0] == pytest.approx(position[0], abs=1e-6)
    assert np.isnan(fix.position[1]).all()


@pytest.mark.parametrize('name', NAMES)
def test_solver_tag_on_an_anchor_is_exact(name):
    """A tag at an anchor's own place, or right under it, is found."""
    low = ROOM.copy()
    low[1, 2] = HEIGHT
    position = np.array([[15.0, 0.0]])
    ranges = distances(position, low)
    ranges[0, 1] = 1e-9  # a range of nothing would be no range
    fix = solve(name, low, ranges, 0.1, HEIGHT)
    assert fix.position == pytest.approx(position, abs=1e-4)
    under = solve(name, ROOM, distances(position), 0.1, HEIGHT)
    assert under.position == pytest.approx(position, abs=1e-4)


@pytest.mark.parametrize('name', NAMES)
def test_solver_circles_that_do_not_meet_are_found_out(name):
    """Ranges that contradict each other give no position, or one that fails the residual test."""
    ranges = np.array([[2.0, 2.0, 2.0, 2.0], [3.0, 30.0, 3.0, 30.0], [1.2, 1.2, 40.0, 1.2]])
    fix = solve(name, ROOM, ranges, 0.1, HEIGHT)
    assert not np.any(fix.consistent(0.001))


@pytest.mark.parametrize('name', NAMES)
@settings(max_examples=40, deadline=None)
@given(
    anchors=st.lists(st.tuples(coordinate, coordinate, height), min_size=3, max_size=6),
    place=st.tuples(coordinate, coordinate),
    noise=st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6),
    gone=st.lists(st.booleans(), min_size=6, max_size=6),
)
def test_solver_any_geometry_is_right_or_says_so(name, anchors, place, noise, gone):
    """In any layout, a fix lies where its covariance, residuals and dilution allow."""
    layout = np.array(anchors)
    count = len(layout)
    ranges = distances(np.array([place]), layout)[0] + np.array(noise[:count])
    ranges[np.array(gone[:count])] = np.nan
    try:
        fix = solve(name, layout, ranges, 0.1, HEIGHT)
    except GeometryError:
        return
    if not fix.solved[0]:
        assert np.isnan(fix.position).all()
        assert np.isnan(fix.covariance).all()
        return
    assert np.isfinite(fix.position).all()
    covariance = fix.covariance[0]
    assert np.linalg.eigvalsh(covariance)[0] >= 0
    error = float(np.hypot(*(fix.position[0] - place)))
    # Errors up to three standard deviations in every range at once.
    claimed = np.sqrt(np.trace(covariance) * fix.excess[0])
    assert error < 12 * claimed + 0.5 or not fix.consistent(0.05)[0]


@pytest.mark.parametrize('name', NAMES)
def test_solver_has_a_page_that_the_docs_link(name):
    """Every solver stands in the table of docs/ranging.md with a page of its own."""
    docs = Path(__file__).parents[5] / 'docs'
    row = re.search(
        rf'^\| .*`{name}`.*\]\((solvers/\w+\.md)\)', (docs / 'ranging.md').read_text(), re.M
    )
    assert row is not None
    assert f'`{name}`' in (docs / row[1]).read_text().splitlines()[0]


def test_solve_unknown_name_lists_those_there_are():
    """A solver that does not exist is refused with the names of those that do."""
    with pytest.raises(ConfigError, match='one of nonlinear, linear'):
        solve('guess', ROOM, distances(np.array([[4.0, 6.0]])), 0.1, HEIGHT)


def test_solve_reports_progress_by_chunk(monkeypatch):
    """Progress is told after each chunk and ends with all; nothing is lost between chunks."""
    monkeypatch.setattr('tablerunner.uwb.solvers.registry.CHUNK', 100)
    position = np.random.default_rng(3).uniform(1, 14, (250, 2))
    told = []
    fix = solve(
        'linear', ROOM, distances(position), 0.1, HEIGHT, progress=lambda *done: told.append(done)
    )
    assert told == [(100, 250), (200, 250), (250, 250)]
    assert fix.position == pytest.approx(position, abs=1e-6)


@pytest.mark.parametrize('name', NAMES)
def test_solve_no_epochs_gives_an_empty_fix(name):
    """No epochs in, none out."""
    fix = solve(name, ROOM, np.empty((0, 4)), 0.1, HEIGHT)
    assert len(fix) == 0
    assert fix.position.shape == (0, 2)
