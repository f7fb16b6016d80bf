"""Displacement by UWB beside that by odometry: what is found, how surely, what is no motion."""

import math

import numpy as np
import pytest

from tablerunner.estimation.motion_comparison import RangeWindow, compare_motion

ANCHORS = np.array([(0.0, 0.0, 2.25), (12.0, 0.0, 2.25), (12.0, 9.0, 2.25), (0.0, 9.0, 2.25)])
HEIGHT, SPAN, STD = 1.1, 2.0, 0.1


def window(rng, extra=(0.0, 0.0), biases=(0.0,) * 4, count=80, way=(1.0, 0.5), anchors=ANCHORS):
    """Return ranges of a tag that moves by `way` as odometry says, and by `extra` besides."""
    times = np.linspace(-SPAN, 0.0, count)
    share = (times / SPAN)[:, None]
    tags = np.array([6.0, 4.0]) + share * np.array(way)
    true = tags + share * np.array(extra)
    index = np.arange(count) % len(anchors)
    places = anchors[index]
    distances = np.linalg.norm(np.column_stack([true, np.full(count, HEIGHT)]) - places, axis=1)
    ranges = distances + np.array(biases)[index] + rng.normal(0.0, STD, count)
    return RangeWindow(times, tags, ranges, np.full(count, STD), index, anchors, HEIGHT)


def compare(*args, **options):
    return compare_motion(window(*args, **options), SPAN)


def test_compare_agreement_is_rarely_taken_for_a_motion():
    """Steady biases of any size and noise are no motion: never 4 deviations in 300 windows.

    The answer is the least certain of five, so that it is smaller than a Rayleigh variable, of
    which 0.03 % lie beyond 4.
    """
    rng = np.random.default_rng(1)
    found = [compare(rng, biases=rng.uniform(-1.0, 1.0, 4)) for _ in range(300)]
    assert max(item.deviations for item in found) < 4.0
    assert max(item.deviations for item in found) > 1.0  # and the deviations are no fantasy


def test_compare_finds_the_difference_of_both_motions():
    """Displacement by UWB less that by odometry, on average right, whatever the direction.

    One window is good to 0.1 m (Fisher information of 80 ranges of 0.1 m, one anchor left out),
    their mean to 0.01 m; the ranges are taken as linear in 0.8 m, which adds as much.
    """
    rng = np.random.default_rng(2)
    for angle in np.linspace(0.0, 2.0 * math.pi, 5, endpoint=False):
        extra = 0.8 * np.array([math.cos(angle), math.sin(angle)])
        found = [compare(rng, extra=extra) for _ in range(60)]
        mean = np.mean([item.displacement for item in found], axis=0)
        assert mean == pytest.approx(extra, abs=0.06)
        assert np.mean([item.deviations > 4.0 for item in found]) > 0.9


def test_compare_one_anchor_that_steps_or_drifts_is_no_motion():
    """A person who steps into one line of sight moves one anchor's ranges, not the robot."""
    rng = np.random.default_rng(3)
    for shape in (lambda t: t > -1.0, lambda t: 1.0 + t / SPAN):
        for _ in range(50):
            item = window(rng)
            excess = np.where(item.anchor == 2, 0.8 * shape(item.times), 0.0)
            found = compare_motion(item._replace(ranges=item.ranges + excess), SPAN)
            assert found.deviations < 4.0


def test_compare_needs_three_anchors_with_ranges_enough():
    """Two anchors, or a third that was heard twice, tell nothing."""
    rng = np.random.default_rng(4)
    item = window(rng, extra=(2.0, 0.0))
    assert compare_motion(item, SPAN) is not None
    for rows in (item.anchor < 2, (item.anchor < 2) | (np.arange(80) < 8)):
        few = RangeWindow(*(part[rows] for part in item[:5]), ANCHORS, HEIGHT)
        assert compare_motion(few, SPAN) is None


def test_compare_anchors_in_one_line_tell_nothing():
    """Seen from the line that they hang on, no anchor shows a step aside."""
    rng = np.random.default_rng(5)
    line = np.array([(0.0, 4.0, HEIGHT), (12.0, 4.0, HEIGHT), (20.0, 4.0, HEIGHT)])
    item = window(rng, way=(1.0, 0.0), anchors=line, biases=(0.0,) * 3)
    assert compare_motion(item, SPAN) is None


def test_compare_blocked_ranges_weigh_less():
    """Ranges that say of themselves that they are worth little make the answer uncertain."""
    rng = np.random.default_rng(6)
    item = window(rng, extra=(0.8, 0.0))
    sure = compare_motion(item, SPAN)
    unsure = compare_motion(item._replace(stds=np.full(80, 3.0)), SPAN)
    assert sure.deviations > 4.0
    assert unsure.deviations < 0.1 * sure.deviations


def test_compare_unknown_heading_makes_a_long_way_uncertain():
    """Odometry in the map is turned by as much as its heading is unknown."""
    item = window(np.random.default_rng(7), extra=(0.0, 0.8), way=(2.0, 0.0))
    assert compare_motion(item, SPAN, 0.02).deviations > 4.0
    assert compare_motion(item, SPAN, 0.4).deviations < 4.0


@pytest.mark.parametrize(
    ('extra', 'least', 'most'),
    [
        ((-1.0, 0.0), 0.8, 1.0),  # all of the way: wheels that spin on the spot
        ((-0.6, 0.0), 0.4, 0.8),
        ((0.8, 0.0), 0.0, 0.0),  # farther than odometry: carried, or UWB at fault
        ((0.0, 0.8), 0.0, 0.0),  # aside
        ((-3.0, 0.0), 0.0, 0.0),  # backwards, three times as far
    ],
)
def test_slipped_only_where_wheels_can_explain_it(extra, least, most):
    """Wheels that slip tell too much, along the way, and at most all of it."""
    rng = np.random.default_rng(8)
    for _ in range(20):
        found = compare(rng, extra=extra, way=(1.0, 0.0), count=400)
        assert least <= found.slipped_m <= most + 1e-9
