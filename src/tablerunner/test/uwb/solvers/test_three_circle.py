"""The closed form of three circles: exact, whatever the order and the signs."""

from itertools import permutations

import numpy as np
import pytest

from tablerunner.uwb import solve
from tablerunner.uwb.solvers.three_circle import three_circles

ROOM = np.array([[0, 0, 2.25], [9, 1, 2.0], [15, 15, 2.25], [0, 15, 3.0]])
HEIGHT = 1.1


def distances(position, anchors):
    tag = np.column_stack([position, np.full(len(position), HEIGHT)])
    return np.linalg.norm(tag[:, None, :] - anchors[None], axis=-1)


@pytest.mark.parametrize('order', list(permutations(range(3))))
def test_three_circles_any_order_meet_in_the_same_point(order):
    """Exact circles meet in the point, in whichever order they come."""
    corners = np.array([[[1.0, 2.0], [8.0, -1.0], [3.0, 9.0]]])[:, order]
    place = np.array([[-4.0, 6.5]])
    found, _ = three_circles(corners, np.sum((corners - place[:, None]) ** 2, axis=2))
    assert found == pytest.approx(place, abs=1e-12)


def test_three_circles_gain_is_the_derivative():
    """The gain agrees with finite differences."""
    corners = np.array([[[1.0, 2.0], [8.0, -1.0], [3.0, 9.0]]])
    squares = np.array([[30.0, 40.0, 20.0]])
    _, gain = three_circles(corners, squares)
    for j in range(3):
        moved = squares.copy()
        moved[0, j] += 1e-3
        change = (three_circles(corners, moved)[0] - three_circles(corners, squares)[0]) / 1e-3
        assert gain[0, :, j] == pytest.approx(change[0], abs=1e-9)


def test_three_circle_takes_the_widest_triangle_that_answered():
    """Of four ranges the widest triple is used; of three, these three."""
    ranges = distances(np.array([[4.0, 6.0], [4.0, 6.0]]), ROOM)
    ranges[1, 2] = np.nan
    fix = solve('three_circle', ROOM, ranges, 0.1, HEIGHT)
    assert fix.used_mask.tolist() == [[True, False, True, True], [True, True, False, True]]


def test_three_circle_noisy_ranges_agree_with_linear():
    """Three noisy ranges have one linear solution: both solvers find it, and its covariance."""
    rng = np.random.default_rng(1)
    anchors = ROOM[:3]
    ranges = distances(rng.uniform(1, 14, (50, 2)), anchors) + rng.normal(0, 0.2, (50, 3))
    one = solve('three_circle', anchors, ranges, 0.2, HEIGHT)
    two = solve('linear', anchors, ranges, 0.2, HEIGHT)
    assert one.position == pytest.approx(two.position, abs=1e-9)
    assert one.covariance == pytest.approx(two.covariance, abs=1e-9)
