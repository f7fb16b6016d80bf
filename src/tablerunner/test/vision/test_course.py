from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.geometry.angles import wrap
from tablerunner.vision import course, course_variance


def test_course_of_many_pairs_at_once() -> None:
    after = np.array([[1.0, 0.0], [0.0, 2.0], [-1.0, -1.0]])
    assert course(np.zeros((3, 2)), after) == pytest.approx([0.0, math.pi / 2, -0.75 * math.pi])


def test_course_variance_covers_noise_and_the_lag_on_a_bend() -> None:
    """Noisy places on circles of turn rates from N(0, 0.8^2), 10 Hz at 0.5 m/s."""
    rng = np.random.default_rng(0)
    std, rate, dt_s, speed = 0.003, 0.8, 0.1, 0.5
    turn = rng.normal(0.0, rate, 4000) * dt_s
    chord = speed * dt_s * np.stack([np.cos(turn / 2), np.sin(turn / 2)], axis=1)
    noise = rng.normal(0.0, std, (2, 4000, 2))
    error = wrap(course(noise[0], chord + noise[1]) - turn)
    expected = course_variance(std**2, std**2, speed * dt_s, dt_s, rate)
    # Of 4000 draws the variance is known to sqrt(2 / 4000) = 2 %.
    assert np.var(error) == pytest.approx(expected, rel=0.1)


def test_course_variance_is_at_most_that_of_an_unknown_direction() -> None:
    assert course_variance(1.0, 1.0, 0.01, 0.1, 0.8) == pytest.approx(math.pi**2)
