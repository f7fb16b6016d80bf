"""A particle filter on any model, its proposals by an EKF, IEKF or LM-IEKF of each particle.

``pf`` draws from the motion (Gordon, Salmond and Smith 1993). The others carry a covariance with
each particle, as the unscented particle filter does (van der Merwe et al. 2000): its Gaussian is
predicted with the Jacobian and the moments of the process noise and corrected by the measurement;
the particle is drawn from that, and weighed by

    likelihood p(z | x) x prior p(x | particle before) / proposal q(x)

as logarithms. Particles are resampled where their effective number falls below a share of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np

from tablerunner.errors import ConfigError
from tablerunner.estimation.particles.iterated import (
    EKF,
    IEKF,
    UIEKF,
    Array,
    Iteration,
    covariance_of,
    drawn,
    update,
)
from tablerunner.estimation.particles.kernel import square_root
from tablerunner.estimation.particles.resampling import RESAMPLERS
from tablerunner.estimation.particles.weights import effective_size, normalised
from tablerunner.types import Matrix, Vector

PROPOSALS: Mapping[str, Iteration | None] = MappingProxyType(
    {'pf': None, 'pf_ekf': EKF, 'pf_iekf': IEKF, 'pf_uiekf': UIEKF}
)
"""By the name of the filter; None: the motion alone."""


class ParticleModel(Protocol):
    """How a state moves and what is measured of it, for n particles at once.

    `step` counts from one; a model that changes with time looks at it.
    """

    def moved(self, states: Matrix, step: int) -> Matrix:
        """Return the expected next states, shape (n, d)."""
        ...

    def motion_slope(self, states: Matrix, step: int) -> Array:
        """Return d(next)/d(state), shape (n, d, d)."""
        ...

    @property
    def motion_covariance(self) -> Matrix:
        """Covariance of the process noise, shape (d, d)."""
        ...

    def draw(self, states: Matrix, step: int, rng: np.random.Generator) -> Matrix:
        """Return next states drawn from the motion, shape (n, d)."""
        ...

    def log_motion(self, states: Matrix, before: Matrix, step: int) -> Vector:
        """Return log p(next | before), shape (n,), with its constants; -inf if impossible."""
        ...

    def expected(self, states: Matrix, step: int) -> Matrix:
        """Return the expected measurements h, shape (n, m)."""
        ...

    def slope(self, states: Matrix, step: int) -> Array:
        """Return dh/d(state), shape (n, m, d)."""
        ...

    @property
    def noise(self) -> Matrix:
        """Covariance R that the proposals take for the measurement's, shape (m, m)."""
        ...

    def log_likelihood(self, states: Matrix, measured: Vector, step: int) -> Vector:
        """Return log p(measured | state), shape (n,)."""
        ...


@dataclass(frozen=True)
class Cloud:
    """Weighted particles after a step.

    Attributes
    ----------
    states : ndarray, shape (n, d)
    covariances : ndarray, shape (n, d, d)
        Of each particle's own filter; of no use to `pf`.
    log_weights : ndarray, shape (n,)
        Normalised.
    """

    states: Matrix
    covariances: Array
    log_weights: Vector

    @property
    def mean(self) -> Vector:
        """Weighted mean, shape (d,)."""
        return np.asarray(np.exp(self.log_weights) @ self.states)


class Told(NamedTuple):
    """What a step came to.

    Attributes
    ----------
    mean : ndarray, shape (d,)
        Of the particles before resampling.
    effective : float
        Their effective number.
    recovered : bool
        Whether no particle explained the measurement, so that all were kept alike.
    worse : float
        Share of the proposals that explain the measurement worse (a higher V) than what they
        began with: iterations that ran away.
    """

    mean: Vector
    effective: float
    recovered: bool
    worse: float


class ParticleFilter:
    """Steps a cloud of particles; keeps nothing between calls.

    Parameters
    ----------
    model : ParticleModel
    proposal : str
        One of `PROPOSALS`.
    resampler : str
        One of `RESAMPLERS`.
    threshold : float
        Share of effective particles below which they are resampled.
    """

    def __init__(
        self,
        model: ParticleModel,
        proposal: str = 'pf',
        resampler: str = 'multinomial',
        threshold: float = 0.5,
    ) -> None:
        if proposal not in PROPOSALS:
            raise ConfigError('proposal', proposal, 'one of ' + ', '.join(PROPOSALS))
        if resampler not in RESAMPLERS:
            raise ConfigError('resampler', resampler, 'one of ' + ', '.join(RESAMPLERS))
        self.model = model
        self.threshold = threshold
        self._iteration = PROPOSALS[proposal]
        self._resample = RESAMPLERS[resampler]

    def start(self, states: Matrix, covariance: Matrix) -> Cloud:
        """Return a cloud of equal weights.

        Raises
        ------
        ConfigError
            There are no particles.
        """
        count = len(states)
        if not count:
            raise ConfigError('particles', count, 'at least one')
        covariances = np.broadcast_to(covariance, (count, *covariance.shape)).copy()
        return Cloud(np.array(states, dtype=float), covariances, np.full(count, -np.log(count)))

    def step(
        self, cloud: Cloud, measured: Vector, step: int, rng: np.random.Generator
    ) -> tuple[Cloud, Told]:
        """Return the cloud after a motion and a measurement, and what came out."""
        moved, log_ratio, worse = self._proposed(cloud, measured, step, rng)
        weights = cloud.log_weights + log_ratio
        weights += self.model.log_likelihood(moved.states, measured, step)
        found = normalised(weights)
        weighed = replace(moved, log_weights=found.log_weights)
        effective = effective_size(found.log_weights)
        told = Told(weighed.mean, effective, found.recovered, worse)
        if effective >= self.threshold * len(weights):
            return weighed, told
        rows = self._resample(np.exp(found.log_weights), len(weights), rng)
        even = np.full(len(rows), -np.log(len(rows)))
        return Cloud(weighed.states[rows], weighed.covariances[rows], even), told

    def _proposed(
        self, cloud: Cloud, measured: Vector, step: int, rng: np.random.Generator
    ) -> tuple[Cloud, Vector | float, float]:
        """Return the drawn particles, log(prior / proposal), and how many searches ran away."""
        model, iteration = self.model, self._iteration
        if iteration is None:
            return replace(cloud, states=model.draw(cloud.states, step, rng)), 0.0, 0.0
        mean = model.moved(cloud.states, step)
        forward = model.motion_slope(cloud.states, step)
        predicted = forward @ cloud.covariances @ np.swapaxes(forward, -1, -2)
        root = square_root(predicted + model.motion_covariance)

        def look(states: Matrix, _: object) -> tuple[Matrix, Array]:
            return measured - model.expected(states, step), model.slope(states, step)

        updated = update(mean, root, look, model.noise, iteration)
        states, _, log_ratio = drawn(mean, root, updated, rng.standard_normal(mean.shape))
        # `drawn` knows the predicted Gaussian for the prior; the model's own takes its place.
        y = np.linalg.solve(root, (states - mean)[..., None])[..., 0]
        gaussian = -0.5 * np.sum(y**2, axis=1) - np.linalg.slogdet(root)[1]
        gaussian -= 0.5 * mean.shape[1] * np.log(2.0 * np.pi)
        log_ratio = log_ratio + model.log_motion(states, cloud.states, step) - gaussian
        moved = Cloud(states, covariance_of(root, updated), cloud.log_weights)
        worse = float(np.mean(updated.cost > updated.first_cost * (1.0 + 1e-9)))
        return moved, log_ratio, worse
