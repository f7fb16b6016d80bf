"""The benchmark of the unscented particle filter (van der Merwe et al. 2000), and a harder one.

    x_k = 1 + sin(0.04 pi k) + 0.5 x_{k-1} + u,     u ~ Gamma(shape 3, rate 2)
    y_k = 0.2 x_k^2 + v  up to step 30,  0.5 x_k - 2 + v  after,     v ~ N(0, 1e-5)

The harder one has a sensor that saturates, y_k = atan(s (x_k - 4)) + v, over the same motion: far
from where it is steep an undamped Gauss-Newton step overshoots, farther each time.
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.particles.iterated import Array
from tablerunner.types import Matrix, Vector

SHAPE, RATE = 3.0, 2.0
SWITCH = 30
"""Last step that is measured by the square."""


class GrowthModel:
    """The benchmark's model.

    Parameters
    ----------
    noise_variance : float
        Of v.
    """

    def __init__(self, noise_variance: float = 1e-5) -> None:
        self.noise: Matrix = np.array([[noise_variance]])
        self.motion_covariance: Matrix = np.array([[SHAPE / RATE**2]])

    def moved(self, states: Matrix, step: int) -> Matrix:
        """Return the expected next states, shape (n, 1)."""
        return self._without_noise(states, step) + SHAPE / RATE

    def motion_slope(self, states: Matrix, _step: int) -> Array:
        """Return d(next)/d(state), shape (n, 1, 1)."""
        return np.full((len(states), 1, 1), 0.5)

    def draw(self, states: Matrix, step: int, rng: np.random.Generator) -> Matrix:
        """Return next states drawn from the motion."""
        noise = rng.gamma(SHAPE, 1.0 / RATE, size=states.shape)
        return np.asarray(self._without_noise(states, step) + noise)

    def log_motion(self, states: Matrix, before: Matrix, step: int) -> Vector:
        """Return the log density of Gamma at what was added."""
        added = (states - self._without_noise(before, step))[:, 0]
        inside = np.where(added > 0.0, added, 1.0)
        log = SHAPE * math.log(RATE) - math.lgamma(SHAPE) + (SHAPE - 1.0) * np.log(inside)
        return np.where(added > 0.0, log - RATE * inside, -np.inf)

    def expected(self, states: Matrix, step: int) -> Matrix:
        """Return the expected measurements, shape (n, 1)."""
        return 0.2 * states**2 if step <= SWITCH else 0.5 * states - 2.0

    def slope(self, states: Matrix, step: int) -> Array:
        """Return dh/dx, shape (n, 1, 1)."""
        slope = 0.4 * states if step <= SWITCH else np.full_like(states, 0.5)
        return slope[:, :, None]

    def log_likelihood(self, states: Matrix, measured: Vector, step: int) -> Vector:
        """Return log p(measured | state), shape (n,)."""
        variance = float(self.noise[0, 0])
        off = (measured - self.expected(states, step))[:, 0]
        return np.asarray(-0.5 * off**2 / variance - 0.5 * math.log(2.0 * math.pi * variance))

    def measure(self, state: Vector, step: int, rng: np.random.Generator) -> Vector:
        """Return a measurement of the true state, shape (1,)."""
        expected = self.expected(state[None], step)[0]
        return np.asarray(expected + rng.normal(scale=math.sqrt(self.noise[0, 0]), size=1))

    @staticmethod
    def _without_noise(states: Matrix, step: int) -> Matrix:
        return np.asarray(1.0 + math.sin(0.04 * math.pi * step) + 0.5 * states)


class SaturatingModel(GrowthModel):
    """The same motion, seen by a sensor that saturates on both sides of 4.

    Parameters
    ----------
    noise_variance : float
    steepness : float
        s.
    """

    def __init__(self, noise_variance: float = 1e-4, steepness: float = 3.0) -> None:
        super().__init__(noise_variance)
        self.steepness = steepness

    def expected(self, states: Matrix, _step: int) -> Matrix:
        """Return the expected measurements, shape (n, 1)."""
        return np.arctan(self.steepness * (states - 4.0))

    def slope(self, states: Matrix, _step: int) -> Array:
        """Return dh/dx, shape (n, 1, 1)."""
        slope = self.steepness / (1.0 + (self.steepness * (states - 4.0)) ** 2)
        return np.asarray(slope[:, :, None])
