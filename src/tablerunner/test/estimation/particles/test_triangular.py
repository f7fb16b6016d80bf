import numpy as np
import pytest

from tablerunner.estimation.particles.triangular import curvature, solved, spread, times

SHAPES = pytest.mark.parametrize(
    ('rows', 'size'), [(1, 1), (1, 3), (2, 3), (4, 3), (3, 1), (4, 4), (3, 6)]
)


@SHAPES
def test_solved_is_numpys(rows, size):
    rng = np.random.default_rng(rows + size)
    slope, pull = rng.normal(0.0, 3.0, (50, rows, size)), rng.normal(size=(50, size))
    expected = np.linalg.solve(curvature(slope), pull[..., None])[..., 0]
    assert solved(slope, pull) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@SHAPES
def test_spread_is_the_root_of_the_inverse(rows, size):
    slope = np.random.default_rng(rows + size).normal(0.0, 3.0, (50, rows, size))
    slope[0] = 0.0  # nothing measured: the identity
    half, log_size = spread(slope)
    inverse = np.linalg.inv(curvature(slope))
    assert half @ np.swapaxes(half, 1, 2) == pytest.approx(inverse, rel=1e-8, abs=1e-10)
    assert log_size == pytest.approx(0.5 * np.linalg.slogdet(inverse)[1], abs=1e-9)
    assert half[0] == pytest.approx(np.eye(size))


@SHAPES
def test_times_is_numpys(rows, size):
    rng = np.random.default_rng(rows + size)
    matrices, vectors = rng.normal(size=(50, rows, size)), rng.normal(size=(50, size))
    expected = np.einsum('kmd,kd->km', matrices, vectors)
    assert times(matrices, vectors) == pytest.approx(expected, abs=1e-12)
