"""An anchor from nothing: on bent ways its place, on straight ones two."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.survey.start import locate_anchor

BENT = np.concatenate(
    [
        np.column_stack([np.linspace(0, 5, 60), np.zeros(60)]),
        np.column_stack([np.full(60, 5.0), np.linspace(0, 4, 60)]),
    ]
)
STRAIGHT = np.column_stack([np.linspace(0, 8, 120), np.zeros(120)])


def ranges_to(place: np.ndarray, tags: np.ndarray, height: float, seed: int) -> np.ndarray:
    flat = np.linalg.norm(tags - place, axis=1)
    return np.hypot(flat, height) + np.random.default_rng(seed).normal(0.0, 0.1, len(tags))


@settings(max_examples=40)
@given(st.floats(-15, 20), st.floats(-15, 20), st.integers(0, 10**6))
def test_the_place_is_found_from_a_bent_way(x: float, y: float, seed: int) -> None:
    """Within four standard deviations of the sharpest direction's bound, or alike with another."""
    place = np.array([x, y])
    flat = np.linalg.norm(BENT - place, axis=1)
    slope = (BENT - place) / np.maximum(np.hypot(flat, 1.2), 0.1)[:, None]
    worst = 0.1 / np.sqrt(np.linalg.eigvalsh(slope.T @ slope)[0])
    found = locate_anchor(BENT, 1.2, ranges_to(place, BENT, 1.2, seed))
    candidates = [found.place, *([] if found.other is None else [found.other])]
    assert min(np.linalg.norm(item - place) for item in candidates) < 4.5 * worst + 0.05


def test_a_straight_way_leaves_both_sides() -> None:
    place = np.array([3.0, 4.0])
    found = locate_anchor(STRAIGHT, 1.2, ranges_to(place, STRAIGHT, 1.2, 1))
    assert found.other is not None
    both = sorted([found.place[1], found.other[1]])
    np.testing.assert_allclose(both, [-4.0, 4.0], atol=0.3)


def test_blocked_ranges_do_not_move_it() -> None:
    place = np.array([-2.0, 6.0])
    ranges = ranges_to(place, BENT, 1.2, 2)
    ranges[10:50:3] += 1.0
    found = locate_anchor(BENT, 1.2, ranges)
    assert found.other is None
    assert np.linalg.norm(found.place - place) < 0.25
