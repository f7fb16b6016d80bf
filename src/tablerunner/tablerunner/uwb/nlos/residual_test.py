"""NLOS from residuals: a range that is longer than everything else says.

Blocked ranges are too long, never too short: only positive innovations speak for NLOS. Against
N(0, S) for a clear range stands N(m, S + s^2) for a blocked one, and Bayes' rule gives the
probability.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.errors import GeometryError
from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.nlos.verdict import NlosVerdict, logistic
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.nonlinear import solve_nonlinear

ROUNDS = 2
"""How often `judge_residuals` looks at an epoch: more rounds find no more."""

SURE = 0.995
"""No other test is believed beyond this probability, either way."""


@dataclass(frozen=True)
class NlosModel:
    """What is expected of blocked ranges.

    Attributes
    ----------
    share : float
        How many of the ranges are blocked.
    mean_m, std_m : float
        How much too long they are.
    threshold : float
        Probability above which a range is called blocked.
    """

    share: float = 0.2
    mean_m: float = 0.6
    std_m: float = 0.5
    threshold: float = 0.5

    def __post_init__(self) -> None:
        if not (0.0 < self.share < 1.0 and self.mean_m >= 0.0 and self.std_m > 0.0):
            raise GeometryError(f'no model of blocked ranges: {self}')


def judge_innovation(
    innovation: ArrayLike,
    variance: ArrayLike,
    model: NlosModel | None = None,
    prior: ArrayLike = float('nan'),
) -> NlosVerdict:
    """Return what innovations say, for arrays of any one shape.

    Parameters
    ----------
    innovation : array_like
        Measured minus expected range [m].
    variance : array_like
        Variance of that difference for a clear range (an estimator's S) [m^2].
    model : NlosModel
    prior : array_like
        Probability that another test has found already; the model's share where it is NaN.
    """
    model = model or NlosModel()
    before = np.asarray(prior, dtype=float)
    share = np.where(np.isfinite(before), np.clip(before, 1.0 - SURE, SURE), model.share)
    spread = np.asarray(variance, dtype=float)
    spread = np.where(spread > 0.0, spread, np.nan)
    # A range that is too short is no more blocked than one that is right.
    excess = np.maximum(np.asarray(innovation, dtype=float), 0.0)
    wide = spread + model.std_m**2
    odds = np.log(share / (1.0 - share)) + 0.5 * (
        excess**2 / spread - (excess - model.mean_m) ** 2 / wide - np.log(wide / spread)
    )
    return NlosVerdict.of(logistic(odds), model.threshold)


def judge_residuals(
    epochs: Epochs, model: NlosModel | None = None, rounds: int = ROUNDS
) -> NlosVerdict:
    """Return what each range of an epoch says against the position from the others.

    Each range is left out in turn; the others are solved, and its innovation is judged. In each
    round the others weigh by what is known of them by then: what another test said at first
    (`Epochs.nlos`), then what the last round found. One blocked range throws the positions of all
    others off, so that the first round accuses clear ones too; the second takes that back. What
    another test said is also the probability that the residual begins with.

    That takes four ranges at least, and five to tell which one it is.

    Parameters
    ----------
    epochs : Epochs
    model : NlosModel, optional
    rounds : int
        One or more.

    Returns
    -------
    NlosVerdict
        Of shape (m, n); no say where the others leave the position open.
    """
    model = model or NlosModel()
    if rounds < 1:
        raise GeometryError(f'{rounds} rounds judge nothing')
    probability = np.asarray(epochs.nlos)
    for _ in range(rounds):
        known = np.where(np.isfinite(probability), probability, 0.0)
        weighed = Epochs(
            epochs.anchors,
            epochs.ranges,
            np.hypot(epochs.std, known * np.hypot(model.mean_m, model.std_m)),
            epochs.tag_height,
            epochs.nlos,
        )
        probability = _left_out(weighed, epochs.std, model)
    return NlosVerdict.of(probability, model.threshold)


def _left_out(epochs: Epochs, own_std: Array, model: NlosModel) -> Array:
    """Return the probability of each range against the others; its own noise is `own_std`."""
    probability = np.full(epochs.ranges.shape, np.nan)
    count = epochs.usable.sum(axis=1)
    for j in range(epochs.ranges.shape[1]):
        rows = epochs.usable[:, j] & (count > MINIMUM_RANGES)
        if not rows.any():
            continue
        keep = np.ones(epochs.ranges.shape[1], dtype=bool)
        keep[j] = False
        some = epochs.some(rows)
        fix = solve_nonlinear(some.masked(np.broadcast_to(keep, some.ranges.shape)))
        offset = fix.position - epochs.anchors[j, :2]
        expected = np.sqrt(np.sum(offset**2, axis=1) + epochs.height[j] ** 2)
        direction = offset / np.maximum(expected, 1e-9)[:, None]
        variance = own_std[rows, j] ** 2 + np.einsum(
            'mi,mij,mj->m', direction, fix.covariance, direction
        )
        verdict = judge_innovation(some.ranges[:, j] - expected, variance, model, some.nlos[:, j])
        probability[rows, j] = verdict.probability
    return probability
