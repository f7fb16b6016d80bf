"""The adjustment: against linear algebra, with blunders, with noise that was said wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from tablerunner.errors import GeometryError
from tablerunner.survey.adjust import Kinds, Rows, adjust

COUNT = 400
TRUE = np.array([1.0, -2.0, 0.5])


def line(seed: int, std: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(COUNT, 3))
    return design, design @ TRUE + std * rng.normal(size=COUNT)


def rows_of(design: np.ndarray, measured: np.ndarray, group: int = 1):
    jacobian, groups = csr_matrix(design), np.full(len(measured), group)
    return lambda at: Rows(design @ at - measured, jacobian, groups)


def test_a_linear_problem_is_solved_as_by_linear_algebra() -> None:
    design, measured = line(0)
    done = adjust(rows_of(design, measured), np.zeros(3), np.ones(3, bool), Kinds(2))
    np.testing.assert_allclose(
        done.values, np.linalg.lstsq(design, measured, rcond=None)[0], atol=1e-6
    )
    np.testing.assert_allclose(done.covariance, np.linalg.inv(design.T @ design), atol=1e-9)


def test_what_is_held_stays_and_is_certain() -> None:
    design, measured = line(1)
    free = np.array([True, False, True])
    done = adjust(rows_of(design, measured), np.array([0.0, 3.0, 0.0]), free, Kinds(2))
    assert done.values[1] == 3.0
    assert not done.covariance[1].any()
    assert done.covariance[0, 0] > 0.0


@pytest.mark.parametrize('robust', [False, True])
@pytest.mark.parametrize('std', [0.5, 3.0])
def test_noise_that_was_said_wrongly_is_found(std: float, robust: bool) -> None:
    """Of 400 residuals: 4 % by their squares, 8 % by half of their sizes; three of it."""
    design, measured = line(2, std)
    kinds = Kinds(2, frozenset({1}), frozenset({1} if robust else ()))
    done = adjust(rows_of(design, measured), np.zeros(3), np.ones(3, bool), kinds)
    assert done.factors[1] == pytest.approx(std, rel=0.24 if robust else 0.12)


def test_blunders_do_not_move_the_answer() -> None:
    """A fifth of the measurements is far too large, as ranges behind things are."""
    design, measured = line(3)
    clean = adjust(rows_of(design, measured), np.zeros(3), np.ones(3, bool), Kinds(2))
    measured[::5] += np.random.default_rng(9).uniform(6.0, 30.0, len(measured[::5]))
    kinds = Kinds(2, frozenset({1}), frozenset({1}))
    done = adjust(rows_of(design, measured), np.zeros(3), np.ones(3, bool), kinds)
    std = np.sqrt(np.diag(clean.covariance))
    assert np.all(np.abs(done.values - clean.values) < 2.0 * std)
    assert np.mean(done.weights[::5] < 0.2) > 0.9
    assert done.factors[1] == pytest.approx(1.0, abs=0.3)


def test_what_is_not_settled_is_refused() -> None:
    design, measured = line(4)
    design[:, 2] = 0.0
    with pytest.raises(GeometryError, match='do not settle'):
        adjust(rows_of(design, measured), np.zeros(3), np.ones(3, bool), Kinds(2))
