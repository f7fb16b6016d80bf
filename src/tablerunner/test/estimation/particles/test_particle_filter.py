import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.estimation.particles.growth_model import GrowthModel, SaturatingModel
from tablerunner.estimation.particles.particle_filter import PROPOSALS, ParticleFilter


class _LinearModel:
    """x' = A x + w, z = H x + v: what a Kalman filter solves."""

    matrix = np.array([[0.9, 0.2], [-0.1, 0.8]])
    row = np.array([[1.0, 0.5]])
    motion_covariance = np.array([[0.3, 0.05], [0.05, 0.2]])
    noise = np.array([[0.1]])

    def moved(self, states, _step):
        return states @ self.matrix.T

    def motion_slope(self, states, _step):
        return np.broadcast_to(self.matrix, (len(states), 2, 2))

    def draw(self, states, step, rng):
        noise = rng.multivariate_normal(np.zeros(2), self.motion_covariance, size=len(states))
        return self.moved(states, step) + noise

    def log_motion(self, states, before, step):
        apart = states - self.moved(before, step)
        square = np.einsum('ki,ij,kj->k', apart, np.linalg.inv(self.motion_covariance), apart)
        log_size = np.log(np.linalg.det(2.0 * np.pi * self.motion_covariance))
        return -0.5 * square - 0.5 * log_size

    def expected(self, states, _step):
        return states @ self.row.T

    def slope(self, states, _step):
        return np.broadcast_to(self.row, (len(states), 1, 2))

    def log_likelihood(self, states, measured, step):
        off = (measured - self.expected(states, step))[:, 0]
        return -0.5 * off**2 / self.noise[0, 0]


@pytest.mark.parametrize('name', list(PROPOSALS))
@pytest.mark.parametrize('resampler', ['multinomial', 'systematic', 'residual'])
def test_filter_follows_the_kalman_filter_on_a_linear_model(name, resampler):
    """Mean within what 4000 particles allow: the exact posterior, whatever the proposal."""
    model, rng = _LinearModel(), np.random.default_rng(3)
    filter_ = ParticleFilter(model, name, resampler)
    cloud = filter_.start(rng.standard_normal((4000, 2)), np.eye(2))
    mean, covariance = np.zeros(2), np.eye(2)
    apart = []
    for step in range(1, 16):
        measured = np.array([np.sin(step)])
        cloud, told = filter_.step(cloud, measured, step, rng)
        covariance = model.matrix @ covariance @ model.matrix.T + model.motion_covariance
        mean = model.matrix @ mean
        spread = model.row @ covariance @ model.row.T + model.noise
        gain = covariance @ model.row.T / spread
        mean = mean + gain @ (measured - model.row @ mean)
        covariance = covariance - gain @ spread @ gain.T
        apart.append((told.mean - mean) / np.sqrt(np.diagonal(covariance)))
    # 1 / sqrt(4000) = 0.016 of a deviation for independent draws; resampling triples it at most.
    assert np.sqrt(np.mean(np.square(apart))) < 0.05


@pytest.mark.parametrize('model', [GrowthModel(), SaturatingModel()])
def test_slope_is_the_difference(model):
    states = np.linspace(0.5, 9.0, 30)[:, None]
    for step in (3, 45):
        ahead, behind = (model.expected(states + way, step) for way in (1e-6, -1e-6))
        assert model.slope(states, step)[:, :, 0] == pytest.approx(
            (ahead - behind) / 2e-6, rel=1e-5, abs=1e-8
        )


def test_motion_density_is_that_of_the_draws():
    """It adds up to one, and has the mean and variance that the proposals take."""
    model = GrowthModel()
    before = np.array([[2.0]])
    base = model.moved(before, 7)[0, 0] - 1.5
    added = np.linspace(1e-4, 20.0, 200_001)
    states = (base + added)[:, None]
    density = np.exp(model.log_motion(states, np.repeat(before, len(states), axis=0), 7))
    step = added[1] - added[0]
    assert density.sum() * step == pytest.approx(1.0, abs=1e-4)
    mean = (density * added).sum() * step
    assert mean == pytest.approx(1.5, abs=1e-3)
    variance = (density * (added - mean) ** 2).sum() * step
    assert variance == pytest.approx(model.motion_covariance[0, 0], abs=1e-3)
    drawn = model.draw(np.full((50_000, 1), 2.0), 7, np.random.default_rng(0))
    assert drawn.mean() == pytest.approx(base + 1.5, abs=0.02)
    assert np.isneginf(model.log_motion(np.array([[base - 0.1]]), before, 7)[0])


def test_a_measurement_that_nothing_explains_is_said_and_survived():
    """A proposal where the motion is impossible gets no weight; all of them do here."""
    model = GrowthModel()
    filter_ = ParticleFilter(model, 'pf_ekf')
    cloud = filter_.start(np.full((20, 1), 50.0), np.array([[1e-6]]))
    cloud, told = filter_.step(cloud, np.array([0.2]), 1, np.random.default_rng(0))
    assert told.recovered
    assert np.all(np.isfinite(cloud.states))
    cloud, told = filter_.step(cloud, np.array([np.nan]), 2, np.random.default_rng(1))
    assert told.recovered


def test_bad_settings_are_refused():
    with pytest.raises(ConfigError, match='one of pf, pf_ekf'):
        ParticleFilter(GrowthModel(), 'ukf')
    with pytest.raises(ConfigError, match='one of multinomial'):
        ParticleFilter(GrowthModel(), 'pf', 'stratified')
    with pytest.raises(ConfigError, match='at least one'):
        ParticleFilter(GrowthModel()).start(np.empty((0, 1)), np.eye(1))


@pytest.mark.parametrize('name', list(PROPOSALS))
def test_one_particle_is_a_filter_too(name):
    model, rng = GrowthModel(), np.random.default_rng(0)
    filter_ = ParticleFilter(model, name)
    cloud = filter_.start(np.ones((1, 1)), np.array([[0.75]]))
    for step in range(1, 5):
        cloud, told = filter_.step(cloud, np.array([2.0]), step, rng)
        assert np.isfinite(told.mean).all()
