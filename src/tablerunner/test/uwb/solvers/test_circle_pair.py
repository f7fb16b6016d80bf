"""Two circles: the points where they meet, and what stands for them where they do not."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tablerunner.uwb import Epochs
from tablerunner.uwb.solvers.circle_pair import blur, intersect, meet

number = st.floats(-20, 20)


def crossing(a, b, radius_a, radius_b, **more):
    return intersect(np.array(a), np.array(b), np.array([radius_a]), np.array([radius_b]), **more)


@given(st.tuples(number, number), st.tuples(number, number), st.tuples(number, number))
def test_intersect_circles_through_a_point_find_it(a, b, place):
    """One of both points is the one that the circles were drawn through; both lie on both."""
    a, b, place = (np.array(value) for value in (a, b, place))
    assume(np.hypot(*(a - b)) > 0.1)
    radii = np.hypot(*(place - a)), np.hypot(*(place - b))
    pair = crossing(a, b, *radii)
    near = [np.hypot(*(point[0] - place)) for point in (pair.first, pair.second)]
    assert min(near) < 1e-4  # a root halves the digits where circles touch
    assert pair.gap[0] < 1e-12


def test_intersect_first_is_left_of_the_way():
    """Seen along the way from the first centre to the second, the first point is left."""
    pair = crossing((0.0, 0.0), (2.0, 0.0), 2.0, 2.0)
    assert pair.first[0] == pytest.approx([1.0, np.sqrt(3.0)])
    assert pair.second[0] == pytest.approx([1.0, -np.sqrt(3.0)])


@pytest.mark.parametrize(
    ('radii', 'gap', 'middle', 'chord'),
    [
        ((3.0, 2.0), 5.0, 5.5, 5.25),
        ((15.0, 2.0), 3.0, 13.5, 16.05),
        ((2.0, 15.0), 3.0, -3.5, -6.05),
    ],
)
def test_intersect_circles_that_miss_give_the_middle_of_the_gap(radii, gap, middle, chord):
    """Apart or one within the other: a point halfway, or on the common chord, and the gap."""
    pair = crossing((0.0, 0.0), (10.0, 0.0), *radii)
    assert pair.gap[0] == pytest.approx(gap)
    assert pair.first[0] == pytest.approx([middle, 0.0])
    assert pair.second[0] == pytest.approx([middle, 0.0])
    assert crossing((0.0, 0.0), (10.0, 0.0), *radii, chord=True).first[0] == pytest.approx(
        [chord, 0.0]
    )


def test_intersect_one_centre_has_no_point():
    """Circles about one centre meet nowhere, or everywhere."""
    assert np.isnan(crossing((1.0, 1.0), (1.0, 1.0), 2.0, 2.0).first).all()


def test_meet_gap_beyond_the_noise_is_no_point():
    """Circles that miss by more than five deviations are a contradiction."""
    anchors = np.array([[0, 0, 1], [10, 0, 1], [0, 10, 1.0]])
    epochs = Epochs.of(anchors, [[4.9, 4.9, 9.0], [4.0, 4.0, 9.0]], 0.1, 1.0)
    first, _ = meet(epochs, epochs.ranges, np.array([[0, 1], [0, 1]]))
    assert first[0] == pytest.approx([5.0, 0.0])
    assert np.isnan(first[1]).all()


def test_blur_circles_that_touch_covers_the_scatter_across():
    """Between two anchors the chord is all noise: the blur has the size of its square."""
    rng = np.random.default_rng(1)
    anchors = np.array([[0, 0, 1], [10, 0, 1], [0, 10, 1.0]])
    ranges = np.column_stack([5 + rng.normal(0, 0.1, (5000, 2)), np.full(5000, 9.0)])
    epochs = Epochs.of(anchors, ranges, 0.1, 1.0)
    pairs = np.tile([0, 1], (5000, 1))
    first, _ = meet(epochs, epochs.ranges, pairs)
    scatter = np.nanmean(first[:, 1] ** 2)
    touching = Epochs.of(anchors, [5.0, 5.0, 9.0], 0.1, 1.0)
    claimed = blur(touching, touching.ranges, np.array([[0, 1]]))[0]
    assert scatter < claimed[1, 1] < 4 * scatter
    assert claimed[0] == pytest.approx([0, 0])
