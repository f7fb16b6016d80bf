"""ROC curves: the measures themselves, and that the tests do tell."""

import numpy as np
import pytest

from tablerunner.experiments.nlos import (
    ALONE,
    KINDS,
    area,
    judged,
    miscalibration,
    reliability,
    roc,
    run_nlos,
)


def test_area_is_the_chance_to_score_higher():
    blocked = np.array([True, True, False, False])
    assert area(np.array([0.9, 0.8, 0.2, 0.1]), blocked) == 1.0
    assert area(np.array([0.1, 0.2, 0.8, 0.9]), blocked) == 0.0
    assert area(np.full(4, 0.5), blocked) == 0.5
    assert area(np.array([0.9, 0.3, 0.5, 0.1]), blocked) == 0.75


def test_roc_of_known_scores():
    """Half of the blocked ones lie above every clear one, the others below."""
    blocked = np.array([True, False, True, False])
    curve = roc(np.array([0.9, 0.7, 0.1, 0.6]), blocked)
    assert curve[1] == pytest.approx(0.5)
    assert curve[-1] == 1.0
    assert np.all(np.diff(curve) >= 0.0)


def test_miscalibration_of_honest_and_of_sure_probabilities():
    rng = np.random.default_rng(0)
    honest = rng.uniform(size=20_000)
    blocked = rng.uniform(size=20_000) < honest
    assert miscalibration(reliability(honest, blocked)) < 0.02
    sure = reliability(np.full(20_000, 0.95), blocked)
    assert miscalibration(sure) == pytest.approx(0.45, abs=0.02)
    assert sure[0].tolist() == [0.0] * 9 + [20_000.0]


def test_ranges_without_a_verdict_are_not_counted():
    bins = reliability(np.array([0.9, np.nan]), np.array([True, True]))
    assert bins[0].sum() == 1.0


@pytest.fixture(scope='module')
def outcome():
    return run_nlos(range(100, 103), lambda done, count: None)


def mean(outcome, name):
    return outcome.row(name).measured.mean


def test_signal_quality_is_the_best_and_so_the_default(outcome):
    """By its curve (spread over 20 seeds: 0.02, gaps 0.08) and by the fixes (0.01 m, 0.05 m)."""
    assert outcome.holds
    assert min(mean(outcome, f'{test}, area') for test in ALONE) > 0.85
    best, *others = (mean(outcome, f'{test}, fixes, RMSE') for test in ALONE)
    assert best < 0.8 * min(others)
    assert max(others) < 0.75 * mean(outcome, 'no test, fixes, RMSE')
    few = [mean(outcome, f'{test}, fixes by four anchors, RMSE') for test in ALONE]
    assert few == sorted(few)


def test_residuals_add_to_the_variance_and_nothing_to_the_signal(outcome):
    """So `residual_test` is off, and worth turning on where the radio has no powers."""
    both = mean(outcome, 'variance + residual, fixes, RMSE')
    assert both < 0.9 * mean(outcome, 'range_variance, fixes, RMSE')
    signal = mean(outcome, 'signal_quality, fixes, RMSE')
    assert mean(outcome, 'signal + residual, fixes, RMSE') > 0.97 * signal


def test_probabilities_are_honest(outcome):
    """What a test calls likely is about as likely: off by 0.06 on average at most."""
    for test in ALONE:
        assert mean(outcome, f'{test}, probability off by') < 0.075


def test_every_kind_of_thing_blocks():
    """A fifth to a third of all ranges, so that the curves rest on hundreds of every kind."""
    drive = judged(100)
    kinds, counts = np.unique(drive.kind, return_counts=True)
    assert set(kinds) == {'', *KINDS}
    assert counts.min() > 100
    there = np.isfinite(drive.ranges)
    assert 0.2 < np.mean(drive.kind[there] != '') < 0.35
