"""The updates against their formulas, the least cost by another way, and exact posteriors."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from tablerunner.estimation.particles.iterated import (
    EKF,
    IEKF,
    UIEKF,
    Iteration,
    covariance_of,
    drawn,
    update,
)
from tablerunner.estimation.particles.kernel import square_root

NOISE = np.array([[0.02, 0.005], [0.005, 0.03]])
ANCHORS = np.array([[0.0, 0.0], [6.0, 0.0]])
MEASURED = np.array([4.2, 5.1])


def ranges(states, _rows=None):
    off = states[:, None, :2] - ANCHORS
    distance = np.linalg.norm(off, axis=2)
    return MEASURED - distance, off / distance[..., None]


def priors(count=40, seed=0):
    rng = np.random.default_rng(seed)
    mean = rng.uniform((1.0, 1.0), (5.0, 6.0), size=(count, 2))
    half = rng.normal(size=(count, 2, 2))
    return mean, half @ np.swapaxes(half, 1, 2) + 0.05 * np.eye(2)


def cost_of(x, mean, covariance, look=ranges, noise=NOISE):
    offset = look(x[None])[0][0]
    apart = x - mean
    return apart @ np.linalg.solve(covariance, apart) + offset @ np.linalg.solve(noise, offset)


def saturating(states, _rows=None):
    return 0.3 - np.arctan(states), (1.0 / (1.0 + states**2))[:, :, None]


def test_one_step_is_the_ekf():
    """K = P H' (H P H' + R)^-1 at the prior mean, P+ = (I - K H) P."""
    mean, covariance = priors()
    root = square_root(covariance)
    updated = update(mean, root, ranges, NOISE, EKF)
    offset, slope = ranges(mean)
    for i in range(len(mean)):
        gain = covariance[i] @ slope[i].T
        gain = gain @ np.linalg.inv(slope[i] @ covariance[i] @ slope[i].T + NOISE)
        assert updated.mean[i] == pytest.approx(mean[i] + gain @ offset[i], abs=1e-9)
        left = (np.eye(2) - gain @ slope[i]) @ covariance[i]
        assert covariance_of(root, updated)[i] == pytest.approx(left, abs=1e-9)


def test_two_steps_are_the_iekf():
    """x2 = m + K1 (z - h(x1) - H1 (m - x1))."""
    mean, covariance = priors()
    root = square_root(covariance)
    first = update(mean, root, ranges, NOISE, Iteration(1)).mean
    second = update(mean, root, ranges, NOISE, Iteration(2, tolerance=0.0)).mean
    offset, slope = ranges(first)
    for i in range(len(mean)):
        gain = covariance[i] @ slope[i].T
        gain = gain @ np.linalg.inv(slope[i] @ covariance[i] @ slope[i].T + NOISE)
        found = mean[i] + gain @ (offset[i] - slope[i] @ (mean[i] - first[i]))
        assert second[i] == pytest.approx(found, abs=1e-8)


@pytest.mark.parametrize('damping', [0.01, 3.0, 500.0])
def test_the_papers_damped_step_is_that_of_the_normal_equations(damping):
    """The formula with P~ (seeds' notes, section 2) against (P^-1 + mu I + H'R^-1H) d = g."""
    mean, covariance = priors(10)
    at = mean + 0.3
    offset, slope = ranges(at)
    for m, p, x, r, h in zip(mean, covariance, at, offset, slope, strict=True):
        tight = (np.eye(2) - p @ np.linalg.inv(p + np.eye(2) / damping)) @ p
        gain = tight @ h.T @ np.linalg.inv(h @ tight @ h.T + NOISE)
        paper = m + gain @ (r - h @ (m - x))
        paper -= damping * (np.eye(2) - gain @ h) @ tight @ (m - x)
        normal = np.linalg.inv(p) + damping * np.eye(2) + h.T @ np.linalg.solve(NOISE, h)
        pull = np.linalg.solve(p, m - x) + h.T @ np.linalg.solve(NOISE, r)
        assert paper == pytest.approx(x + np.linalg.solve(normal, pull), abs=1e-9)


@pytest.mark.parametrize('iteration', [IEKF, UIEKF])
def test_iterated_mean_is_the_maximum_a_posteriori(iteration):
    """Against SciPy's least squares on the same cost, from the same start."""
    mean, covariance = priors()
    tight = Iteration(100, iteration.damped, 1e-9)
    updated = update(mean, square_root(covariance), ranges, NOISE, tight)
    whiten = np.linalg.inv(np.linalg.cholesky(NOISE))
    assert updated.converged.mean() > 0.9  # the undamped one may fail now and then
    for i in np.flatnonzero(updated.converged):
        prior = np.linalg.inv(np.linalg.cholesky(covariance[i]))

        def residuals(x, prior=prior, m=mean[i]):
            return np.concatenate([prior @ (x - m), whiten @ ranges(x[None])[0][0]])

        best = least_squares(residuals, updated.mean[i], xtol=1e-14, gtol=1e-14)
        assert updated.mean[i] == pytest.approx(best.x, abs=1e-6)
        assert updated.cost[i] == pytest.approx(cost_of(best.x, mean[i], covariance[i]), rel=1e-9)


@pytest.mark.parametrize('seed', range(5))
def test_damped_never_raises_the_cost_where_undamped_runs_away(seed):
    """Priors far out on an arctangent: Gauss-Newton overshoots, Levenberg-Marquardt does not."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform(-6.0, 6.0, size=(200, 1))
    root = np.full((200, 1, 1), 2.0)
    noise = np.array([[1e-4]])
    free = update(mean, root, saturating, noise, IEKF)
    damped = update(mean, root, saturating, noise, UIEKF)
    assert np.all(damped.cost <= damped.first_cost)
    assert np.mean(free.cost > free.first_cost) > 0.05
    assert damped.converged.mean() > 0.95
    at = np.linspace(-8.0, 8.0, 4001)[:, None]
    offset = saturating(at)[0]
    grid = (at - mean.T) ** 2 / 4.0 + offset**2 / noise[0, 0]
    # The grid is 4 mm wide: near its least, V is higher by up to (0.002 / 0.01)^2.
    assert np.all(damped.cost <= grid.min(axis=0) + 0.04)


def test_each_fewer_steps_cost_more():
    """With every step that is allowed, the damped cost falls or stays."""
    mean = np.linspace(-6.0, 6.0, 50)[:, None]
    root, noise = np.full((50, 1, 1), 2.0), np.array([[1e-4]])
    costs = [
        update(mean, root, saturating, noise, Iteration(steps, damped=True)).cost
        for steps in range(2, 20)
    ]
    assert np.all(np.diff(costs, axis=0) <= 0.0)


def test_damped_takes_the_undamped_steps_where_those_go_down():
    """It begins with mu = 0."""
    mean, covariance = priors(60, seed=2)
    root = square_root(0.01 * covariance)
    free = update(mean, root, ranges, NOISE, IEKF)
    damped = update(mean, root, ranges, NOISE, UIEKF)
    assert np.array_equal(free.mean, damped.mean)


@pytest.mark.parametrize('iteration', [EKF, IEKF, UIEKF])
def test_linear_measurement_is_one_kalman_step(iteration):
    mean, covariance = priors()
    matrix = np.array([[1.0, 0.5], [0.0, 2.0]])

    def linear(states, rows):
        return MEASURED - states @ matrix.T, np.broadcast_to(matrix, (len(rows), 2, 2))

    root = square_root(covariance)
    updated = update(mean, root, linear, NOISE, iteration)
    for i in range(len(mean)):
        information = np.linalg.inv(covariance[i]) + matrix.T @ np.linalg.solve(NOISE, matrix)
        exact = np.linalg.inv(information)
        assert covariance_of(root, updated)[i] == pytest.approx(exact, rel=1e-6, abs=1e-9)
        pull = np.linalg.solve(covariance[i], mean[i]) + matrix.T @ np.linalg.solve(
            NOISE, MEASURED
        )
        assert updated.mean[i] == pytest.approx(exact @ pull, abs=1e-6)


def test_a_known_state_is_not_moved():
    """P singular: no inverse of it is taken."""
    mean = np.array([[2.0, 3.0]])
    root = square_root(np.diag([0.5, 0.0])[None])
    updated = update(mean, root, ranges, NOISE, UIEKF)
    assert updated.mean[0, 1] == 3.0
    assert updated.mean[0, 0] != 2.0


def test_draws_have_the_updated_mean_and_covariance():
    count = 40000
    mean, covariance = (np.repeat(part[:1], count, axis=0) for part in priors(1, seed=4))
    root = square_root(covariance)
    updated = update(mean, root, ranges, NOISE, UIEKF)
    noise = np.random.default_rng(0).standard_normal((count, 2))
    states, _, _ = drawn(mean, root, updated, noise)
    expected = covariance_of(root, updated)[0]
    deviations = np.sqrt(np.diagonal(expected))
    # Four deviations of a mean and of a covariance of so many draws.
    assert np.abs(states.mean(axis=0) - updated.mean[0]).max() < 4.0 * deviations.max() / 200.0
    scaled = (np.cov(states.T) - expected) / np.outer(deviations, deviations)
    assert np.abs(scaled).max() < 4.0 * np.sqrt(2.0 / count)


def test_weights_make_the_proposal_the_prior_again():
    """Importance sampling: weighed by prior / proposal, the draws have the prior's moments."""
    count = 200_000
    mean = np.zeros((count, 1))
    root = np.ones((count, 1, 1))

    def look(states, _rows):
        return 0.5 - states, np.ones((len(states), 1, 1))

    updated = update(mean, root, look, np.array([[2.0]]), EKF)
    noise = np.random.default_rng(1).standard_normal((count, 1))
    states, _, ratio = drawn(mean, root, updated, noise)
    weights = np.exp(ratio)
    # The proposal's variance is 2/3: weights have a finite variance, and 1 % is four deviations.
    assert weights.mean() == pytest.approx(1.0, abs=0.01)
    assert np.average(states[:, 0], weights=weights) == pytest.approx(0.0, abs=0.02)
    assert np.average(states[:, 0] ** 2, weights=weights) == pytest.approx(1.0, abs=0.03)
