"""Triangle centroids: the inner triangle, and the mean of all."""

import numpy as np
import pytest

from tablerunner.uwb import Epochs, FixState, solve
from tablerunner.uwb.solvers.centroid import triangle_centroid

ROOM = np.array([[0, 0, 4], [0, 10, 4], [10, 10, 4], [10, 0, 4.0]])
HEIGHT = 0.5
POINTS = np.array(
    [(2, 5), (4, 4), (6, 8), (8, 9), (5, 5), (2, 8), (3, 9), (8, 5), (7, 2), (9, 3)], dtype=float
)


def distances(position):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - ROOM[None], axis=-1)


def test_triangle_centroid_of_overlapping_circles_is_that_of_the_inner_points():
    """With ranges too long, each corner is the intersection inside the third circle."""
    anchors = np.array([[0, 0, 0], [8, 0, 0], [4, 6.928203, 0]])
    ranges = np.full((1, 3), 5.0)
    epochs = Epochs.of(anchors, ranges, 0.1, 0.0)
    centroid = triangle_centroid(epochs, ranges, (0, 1, 2))
    # By symmetry the centre of the triangle; its corner over the base is at (4, 3).
    assert centroid[0] == pytest.approx([4.0, 4 / np.sqrt(3)], abs=1e-5)


def test_twice_centroid_is_the_mean_of_the_four_single_ones():
    """All four triples of four anchors count alike."""
    rng = np.random.default_rng(1)
    ranges = distances(POINTS) + rng.normal(0.1, 0.1, (10, 4))
    single = []
    for gone in range(4):
        left = ranges.copy()
        left[:, gone] = np.nan
        single.append(solve('centroid', ROOM, left, 0.2, HEIGHT).position)
    twice = solve('twice_centroid', ROOM, ranges, 0.2, HEIGHT)
    assert twice.position == pytest.approx(np.mean(single, axis=0), abs=1e-9)


def test_twice_centroid_beats_one_as_in_the_paper():
    """With positive errors of the paper's size the second centroid saves a third (Lv table V)."""
    rng = np.random.default_rng(2)
    position = np.repeat(POINTS, 300, axis=0)
    ranges = distances(position)
    ranges += np.abs(rng.normal(0, 0.2, ranges.shape)) + rng.normal(0, 0.1, ranges.shape)
    once, twice = (
        np.linalg.norm(solve(name, ROOM, ranges, 0.2, HEIGHT).position - position, axis=1).mean()
        for name in ('centroid', 'twice_centroid')
    )
    assert 0.5 < twice / once < 0.72


def test_centroid_circles_far_apart_are_no_fix():
    """Circles that noise cannot make meet leave no triangle, and the reason is said."""
    fix = solve('centroid', ROOM, np.full((1, 4), 4.0), 0.1, HEIGHT)
    assert fix.state[0] == FixState.NO_MEETING
