"""Modified hyperbolic: a pair of circles makes the point, the others choose."""

import numpy as np
import pytest

from tablerunner.uwb import FixState, solve

SIDE_X, SIDE_Y = 0.502, 0.510
ROBOT = (
    np.array(
        [
            [SIDE_X, SIDE_Y, 1.2],
            [-SIDE_X, SIDE_Y, 1.2],
            [-SIDE_X, -SIDE_Y, 1.2],
            [SIDE_X, -SIDE_Y, 1.2],
        ]
    )
    / 2
)
BIAS = np.array([-0.010, -0.180, 0.056, -0.029])


@pytest.mark.parametrize(
    ('name', 'paper'), [('linear', 610.2), ('residual_weighted', 547.6), ('hyperbolic', 686.1)]
)
def test_baselines_of_bae_have_errors_of_the_papers_size(name, paper):
    """On the paper's circle and range errors the mean errors are within 10 % (Bae table 5)."""
    rng = np.random.default_rng(1)
    angle = np.linspace(0, 2 * np.pi, 2000)
    position = 2.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    ranges = np.linalg.norm(position[:, None] - ROBOT[:, :2], axis=2) + BIAS
    fix = solve(name, ROBOT, ranges + rng.normal(0, 0.05, ranges.shape), 0.05, 0.6)
    error = 1e3 * np.linalg.norm(fix.position - position, axis=1)
    assert error.mean() == pytest.approx(paper, rel=0.1)


def test_hyperbolic_three_ranges_use_the_third_only_for_the_side():
    """Of three ranges the position lies on two circles exactly, off the third."""
    anchors = np.array([[0, 0, 1], [10, 0, 1], [3, 9, 1.0]])
    ranges = np.array([[5.0, 7.0, 7.3]])
    fix = solve('hyperbolic', anchors, ranges, 0.3, 1.0)
    off = np.abs(np.linalg.norm(fix.position - anchors[:, :2], axis=1) - ranges[0])
    assert np.sort(off)[:2] == pytest.approx([0, 0], abs=1e-9)
    assert off.max() > 0.01


def test_hyperbolic_third_anchor_on_the_line_of_the_pair_cannot_choose():
    """Where the third range fits both points as well, there is no fix."""
    anchors = np.array([[0, 0, 1], [10, 0, 1], [5, 0.02, 1.0]])
    ranges = np.linalg.norm(np.array([[4.0, 3.0]]) - anchors[:, :2], axis=1)
    fix = solve('hyperbolic', anchors, ranges, 0.1, 1.0)
    assert fix.state[0] == FixState.AMBIGUOUS
