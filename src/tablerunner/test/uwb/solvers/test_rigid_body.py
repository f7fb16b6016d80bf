"""Position and heading of a body with several tags."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.errors import CovarianceError, GeometryError
from tablerunner.uwb import FixState
from tablerunner.uwb.solvers.rigid_body import solve_rigid_body

ANCHORS = np.array([[0, 0, 2.2], [8, 0, 2.3], [8, 6, 2.1], [0, 6, 2.2], [4, 0, 2.0]], dtype=float)
TAGS = np.array([[0.25, 0.0, 0.1], [-0.2, 0.2, 0.0], [-0.2, -0.2, 0.0]])
HEIGHT = 0.9


def ranges_at(pose):
    x, y, heading = np.moveaxis(np.atleast_2d(pose), 1, 0)
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    tags = np.stack(
        [
            x[:, None] + cos * TAGS[:, 0] - sin * TAGS[:, 1],
            y[:, None] + sin * TAGS[:, 0] + cos * TAGS[:, 1],
            np.broadcast_to(HEIGHT + TAGS[:, 2], (len(x), 3)),
        ],
        axis=-1,
    )
    return np.linalg.norm(tags[:, None] - ANCHORS[None, :, None], axis=3)


def turned(angle):
    return np.angle(np.exp(1j * np.asarray(angle)))


@given(st.floats(0.5, 7.5), st.floats(0.5, 5.5), st.floats(-3.14, 3.14))
def test_exact_ranges_give_the_pose(x, y, heading):
    fix = solve_rigid_body(ANCHORS, TAGS, ranges_at([x, y, heading]), 0.05, HEIGHT)
    assert fix.solved.all()
    assert fix.position[0] == pytest.approx([x, y], abs=1e-5)
    assert turned(fix.heading[0] - heading) == pytest.approx(0.0, abs=1e-5)


def test_covariance_is_that_of_the_errors():
    """NEES of three degrees of freedom over 2000 epochs; Huber's weights cost a few percent."""
    rng = np.random.default_rng(3)
    pose = np.column_stack([rng.uniform(1, 7, 2000), rng.uniform(1, 5, 2000), np.zeros(2000)])
    pose[:, 2] = rng.uniform(-3, 3, 2000)
    ranges = ranges_at(pose) + rng.normal(scale=0.05, size=(2000, 5, 3))
    fix = solve_rigid_body(ANCHORS, TAGS, ranges, 0.05, HEIGHT)
    error = np.column_stack([fix.position - pose[:, :2], turned(fix.heading - pose[:, 2])])
    nees = np.einsum('mi,mij,mj->m', error, np.linalg.inv(fix.covariance), error)
    assert 2.7 < nees.mean() < 3.2


def test_blocked_range_hardly_moves_the_pose():
    """One range 2 m too long: half a metre and half a radian without Huber's weights."""
    ranges = ranges_at([3.0, 2.0, 0.7])
    ranges[0, 1, 0] += 2.0
    fix = solve_rigid_body(ANCHORS, TAGS, ranges, 0.05, HEIGHT)
    assert fix.position[0] == pytest.approx([3.0, 2.0], abs=0.05)
    assert fix.heading[0] == pytest.approx(0.7, abs=0.2)


def test_missing_ranges():
    """Two tags are enough; one leaves the heading open; nothing leaves everything open."""
    ranges = np.repeat(ranges_at([3.0, 2.0, 0.7]), 3, axis=0)
    ranges[0, :, 2] = np.nan
    ranges[1, :, 1:] = np.nan
    ranges[2] = np.nan
    fix = solve_rigid_body(ANCHORS, TAGS, ranges, 0.05, HEIGHT)
    assert fix.state.tolist() == [FixState.SOLVED, FixState.AMBIGUOUS, FixState.TOO_FEW]
    assert fix.position[0] == pytest.approx([3.0, 2.0], abs=1e-5)
    assert np.isnan(fix.position[1:]).all()
    assert np.isnan(fix.heading[1:]).all()


@pytest.mark.parametrize(
    ('tags', 'shape', 'std', 'error', 'words'),
    [
        (TAGS[:1], (1, 5, 1), 0.05, GeometryError, 'at least 2'),
        (TAGS[[0, 0]], (1, 5, 2), 0.05, GeometryError, 'one spot'),
        (TAGS, (1, 4, 3), 0.05, GeometryError, r'\(m, 5, 3\) is needed'),
        (TAGS, (1, 5, 3), 0.0, CovarianceError, 'standard deviation of a range is 0'),
    ],
)
def test_bad_input_is_named(tags, shape, std, error, words):
    with pytest.raises(error, match=words):
        solve_rigid_body(ANCHORS, tags, np.ones(shape), std, HEIGHT)
