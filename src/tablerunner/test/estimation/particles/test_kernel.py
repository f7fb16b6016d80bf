import numpy as np
import pytest

from tablerunner.estimation.particles.kernel import bandwidth, regularised, square_root

COVARIANCE = np.array([[4.0, 0.6, 0.0], [0.6, 1.0, -0.1], [0.0, -0.1, 0.04]])


def test_bandwidth_is_silvermans_in_one_dimension():
    """(4 / 3n)^(1/5), his rule for a Gaussian."""
    assert bandwidth(100, 1) == pytest.approx((4.0 / 300.0) ** 0.2)


def test_copies_are_spread_by_the_kernel():
    """One place copied: what comes out has the covariance h^2 P (2 % of 20000 draws)."""
    copies = np.tile([1.0, -2.0, 0.5], (20000, 1))
    spread = regularised(copies, COVARIANCE, np.random.default_rng(2))
    width = bandwidth(20000, 3)
    assert spread.mean(axis=0) == pytest.approx(copies[0], abs=0.03)
    scale = np.sqrt(np.diagonal(COVARIANCE))
    found = np.cov(spread.T) / np.outer(scale, scale)
    expected = width**2 * COVARIANCE / np.outer(scale, scale)
    assert found == pytest.approx(expected, abs=0.04 * width**2)


def test_a_cloud_grows_by_the_square_of_the_bandwidth():
    rng = np.random.default_rng(4)
    cloud = rng.multivariate_normal(np.zeros(3), COVARIANCE, size=20000)
    grown = np.cov(regularised(cloud, COVARIANCE, rng).T)
    ratio = np.trace(np.linalg.solve(COVARIANCE, grown)) / 3.0
    assert ratio == pytest.approx(1.0 + bandwidth(20000, 3) ** 2, abs=0.02)


def test_the_bandwidth_is_optimal():
    """Of half, once and twice the bandwidth, it gives the least integrated square error."""
    at = np.linspace(-5.0, 5.0, 400)
    density = np.exp(-0.5 * at**2) / np.sqrt(2.0 * np.pi)

    def error(factor):
        rng, total = np.random.default_rng(5), 0.0
        for _ in range(40):
            samples, width = rng.standard_normal(200), factor * bandwidth(200, 1)
            kernels = np.exp(-0.5 * ((at[:, None] - samples) / width) ** 2)
            found = kernels.mean(axis=1) / (width * np.sqrt(2.0 * np.pi))
            total += np.sum((found - density) ** 2)
        return total

    assert error(1.0) < min(error(0.5), error(2.0))


def test_a_state_that_is_known_stays():
    root = square_root(np.diag([1.0, 0.0]))
    assert root @ root.T == pytest.approx(np.diag([1.0, 0.0]))
    moved = regularised(np.ones((50, 2)), np.diag([1.0, 0.0]), np.random.default_rng(0))
    assert np.array_equal(moved[:, 1], np.ones(50))
