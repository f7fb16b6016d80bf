"""Innovations and left-out residuals tell which range is too long."""

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb import Epochs, solve_positions
from tablerunner.uwb.nlos import NlosModel, judge_innovation, judge_residuals

ROOM = np.array(
    [[0, 0, 2.2], [15, 0, 2.2], [15, 15, 2.2], [0, 15, 2.2], [7, 16, 2.2], [7, -1, 2.2]]
)
HEIGHT = 1.1


def epochs_of(rng, count, std=0.1):
    position = rng.uniform(2, 13, (count, 2))
    tag = np.column_stack([position, np.full(count, HEIGHT)])
    return np.linalg.norm(tag[:, None] - ROOM, axis=2) + rng.normal(0, std, (count, 6))


def test_judge_innovation_is_calibrated_on_its_own_model():
    """Among ranges given a probability, that share is blocked."""
    rng = np.random.default_rng(1)
    model = NlosModel(share=0.3, mean_m=0.6, std_m=0.2)
    blocked = rng.random(200_000) < 0.3
    innovation = rng.normal(0, 0.15, 200_000) + blocked * rng.normal(0.6, 0.2, 200_000)
    probability = judge_innovation(innovation, 0.15**2, model).probability
    for low in (0.1, 0.3, 0.5, 0.7, 0.9):
        here = (probability > low - 0.05) & (probability < low + 0.05)
        assert blocked[here].mean() == pytest.approx(low, abs=0.06)


def test_judge_innovation_negative_is_no_sign_of_blocking():
    """A range that is too short, however much, is no more blocked than a right one."""
    at = judge_innovation(np.array([-5.0, -0.3, 0.0, 0.3, 1.0]), 0.01).probability
    assert at[0] == at[1] == at[2] < at[3] < at[4]
    assert at[2] < 0.2


def test_judge_innovation_unknown_variance_has_no_say():
    """Without a variance, or without an innovation, there is no probability."""
    verdict = judge_innovation(np.array([1.0, np.nan, 1.0]), np.array([0.0, 0.1, np.nan]))
    assert np.isnan(verdict.probability).all()
    assert not verdict.blocked.any()


def test_judge_residuals_finds_the_blocked_range_of_six():
    """A range one metre too long is found and the clear ones are mostly left alone."""
    rng = np.random.default_rng(2)
    ranges = epochs_of(rng, 600)
    bad = rng.integers(0, 6, 600)
    clear = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT)).blocked
    assert clear.mean() < 0.02
    ranges[np.arange(600), bad] += 1.0
    verdict = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT))
    assert verdict.blocked[np.arange(600), bad].mean() > 0.95
    assert np.mean(np.argmax(verdict.probability, axis=1) == bad) > 0.9


def test_judge_residuals_compares_with_the_others_alone():
    """The innovation is that against the position without the range, with both variances."""
    ranges = epochs_of(np.random.default_rng(4), 5)
    probability = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT), rounds=1).probability
    for j in range(6):
        others = np.delete(np.arange(6), j)
        fix = solve_positions(ROOM[others], ranges[:, others], 0.1, HEIGHT)
        offset = np.column_stack([fix.position, np.full(5, HEIGHT)]) - ROOM[j]
        expected = np.linalg.norm(offset, axis=1)
        along = offset[:, :2] / expected[:, None]
        variance = 0.1**2 + np.einsum('mi,mij,mj->m', along, fix.covariance, along)
        alone = judge_innovation(ranges[:, j] - expected, variance).probability
        assert probability[:, j] == pytest.approx(alone, abs=1e-6)


def blocked_rooms(seed, count, share):
    """Return ranges of which a share is 0.2 to 1 m too long, and which."""
    rng = np.random.default_rng(seed)
    ranges = epochs_of(rng, count)
    blocked = rng.random(ranges.shape) < share
    return ranges + blocked * rng.uniform(0.2, 1.0, ranges.shape), blocked


def brier(probability, blocked):
    """Return the mean square of what the probabilities are off: 0.19 for always saying 0.25."""
    return float(np.nanmean((probability - blocked) ** 2))


@pytest.mark.parametrize('seed', range(5))
def test_judge_residuals_second_round_acquits_clear_ranges(seed):
    """With a quarter blocked, most false alarms are taken back; probabilities get better."""
    ranges, blocked = blocked_rooms(seed, 2000, 0.25)
    once, twice = (judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT), rounds=n) for n in (1, 2))
    assert once.blocked[~blocked].mean() > 0.1
    assert twice.blocked[~blocked].mean() < 0.4 * once.blocked[~blocked].mean()
    assert brier(twice.probability, blocked) < 0.7 * brier(once.probability, blocked)


def test_judge_residuals_begins_with_what_another_test_said():
    """A test that is right four times in five, and honest about it, makes this one better."""
    ranges, blocked = blocked_rooms(7, 2000, 0.25)
    right = np.random.default_rng(8).random(blocked.shape) < 0.8
    other = np.where(right == blocked, 0.57, 0.08)  # Bayes: 0.8 and 0.2 with a quarter blocked
    alone = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT)).probability
    both = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT, other)).probability
    assert brier(both, blocked) < 0.8 * min(brier(alone, blocked), brier(other, blocked))


def test_judge_innovation_prior_takes_the_place_of_the_share():
    """Odds multiply; a test that was sure can still be overruled; NaN stands for the share."""
    model = NlosModel()

    def odds(prior):
        p = float(judge_innovation(0.3, 0.02, model, prior).probability)
        return p / (1.0 - p)

    assert odds(0.5) == pytest.approx(odds(float('nan')) * (1.0 - model.share) / model.share)
    assert odds(0.0) == odds(1e-9) > 0.0
    assert judge_innovation(1.5, 0.01, model, 0.0).blocked


def test_judge_residuals_no_round_raises():
    with pytest.raises(GeometryError, match='rounds'):
        judge_residuals(Epochs.of(ROOM, np.full((1, 6), 9.0), 0.1, HEIGHT), rounds=0)


def test_judge_residuals_with_three_ranges_has_no_say():
    """Two ranges tell no place to compare the third with."""
    ranges = epochs_of(np.random.default_rng(3), 2)
    ranges[0, 3:] = np.nan
    verdict = judge_residuals(Epochs.of(ROOM, ranges, 0.1, HEIGHT))
    assert np.isnan(verdict.probability[0]).all()
    assert np.isfinite(verdict.probability[1]).all()


@pytest.mark.parametrize('change', [{'share': 0.0}, {'share': 1.0}, {'mean_m': -1}, {'std_m': 0}])
def test_nlos_model_impossible_raises(change):
    """Shares outside 0 to 1 and lengths that are none are refused."""
    with pytest.raises(GeometryError):
        NlosModel(**change)
