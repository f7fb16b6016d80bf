"""Two clear ranges make the place, blocked ones only choose the side."""

import numpy as np
import pytest

from tablerunner.uwb import FixState, solve

LIU = np.array([[8.7, 5.1, 1.87], [8.91, 7.4, 1.87], [24.8, 6.13, 1.87], [24.8, 8.99, 1.87]])
ROOM = np.array([[0, 0, 2.25], [15, 0, 2.25], [15, 15, 2.25], [0, 15, 2.25]])
HEIGHT = 0.4


def distances(position, anchors):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - anchors[None], axis=-1)


def test_two_anchor_blocked_ranges_do_not_move_the_place():
    """However long the blocked ranges are, the place is that of the clear ones."""
    position = np.array([[4.0, 6.0]])
    nlos = [[0.1, np.nan, 0.9, 0.8]]
    for extra in (0.0, 0.4, 3.0):
        ranges = distances(position, ROOM) + np.array([0, 0, extra, extra])
        fix = solve('two_anchor', ROOM, ranges, 0.1, HEIGHT, nlos)
        assert fix.position == pytest.approx(position, abs=1e-6)
        assert fix.used_mask.tolist() == [[True, True, False, False]]


def test_two_anchor_errors_fit_the_covariance_in_the_room():
    """Adjacent clear anchors and exponential errors of the others: right side, honest spread."""
    rng = np.random.default_rng(1)
    position = rng.uniform(2, 13, (3000, 2))
    ranges = distances(position, ROOM) + rng.normal(0, 0.1, (3000, 4))
    ranges[:, 2:] += rng.exponential(1.0, (3000, 2))
    fix = solve('two_anchor', ROOM, ranges, 0.1, HEIGHT, [0, 0, 1, 1])
    assert fix.solved.mean() > 0.99
    error = (fix.position - position)[fix.solved]
    nees = np.einsum('mi,mij,mj->m', error, np.linalg.inv(fix.covariance[fix.solved]), error)
    assert 1.8 < nees.mean() < 2.3


def test_two_anchor_side_in_the_corridor_of_liu():
    """In Liu's corridor the far blocked ranges tell the side where it can be told."""
    rng = np.random.default_rng(2)
    position = np.column_stack([rng.uniform(11, 22, 2000), rng.uniform(4.0, 5.5, 2000)])
    ranges = distances(position, LIU) + rng.normal(0, 0.03, (2000, 4))
    ranges[:, [1, 3]] += rng.exponential(0.5, (2000, 2))
    fix = solve('two_anchor', LIU, ranges, 0.03, HEIGHT, [0, 1, 0, 1])
    error = np.linalg.norm(fix.position - position, axis=1)[fix.solved]
    # An error of metres is the wrong side.
    claimed = np.sqrt(np.trace(fix.covariance, axis1=1, axis2=2))[fix.solved]
    assert np.mean(error > 3 * claimed + 0.1) < 0.02


def test_two_anchor_no_blocked_range_leaves_the_side_open():
    """Two clear ranges and nothing else are no position; so is one clear range with any others."""
    ranges = distances(np.array([[4.0, 6.0]] * 2), ROOM)
    ranges[0, 2:] = np.nan
    fix = solve('two_anchor', ROOM, ranges, 0.1, HEIGHT, [[0, 0, 0, 0], [1, 1, 0, 1]])
    assert fix.state.tolist() == [FixState.AMBIGUOUS, FixState.TOO_FEW]
    assert np.isnan(fix.position).all()


def test_two_anchor_circles_that_miss_each_other_are_no_fix():
    """Two clear ranges that cannot both be right are refused."""
    ranges = np.array([[3.0, 3.0, 15.0, 15.0]])
    fix = solve('two_anchor', ROOM, ranges, 0.1, HEIGHT, [0, 0, 1, 1])
    assert fix.state[0] == FixState.NO_MEETING


def test_two_anchor_clear_range_shorter_than_its_height_is_no_fix():
    """A range that cannot reach the anchor's height is a contradiction, not a place under it."""
    ranges = np.array([[1.0, 15.1, 15.0, 21.0]])  # the second circle goes through that place
    fix = solve('two_anchor', ROOM, ranges, 0.05, HEIGHT, [0, 0, 1, 1])
    assert fix.state[0] == FixState.NO_MEETING


def test_two_anchor_three_clear_ranges_are_solved_by_least_squares():
    """With three clear ranges the blocked one has no say."""
    ranges = distances(np.array([[4.0, 6.0]]), ROOM) + np.array([0.1, -0.1, 0.05, 2.0])
    some = np.where([True, True, True, False], ranges, np.nan)
    fix = solve('two_anchor', ROOM, ranges, 0.1, HEIGHT, [0, 0, 0, 1])
    assert fix.position == pytest.approx(solve('nonlinear', ROOM, some, 0.1, HEIGHT).position)
