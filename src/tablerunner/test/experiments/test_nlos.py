"""ROC curves: the measures themselves, and that the tests do tell."""

import numpy as np
import pytest

from tablerunner.experiments.nlos import TESTS, area, judged, miscalibration, roc, run_nlos


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
    assert miscalibration(honest, blocked) < 0.02
    assert miscalibration(np.full(20_000, 0.95), blocked) == pytest.approx(0.45, abs=0.02)


@pytest.fixture(scope='module')
def outcome():
    return run_nlos(range(100, 103), lambda done, count: None)


def test_signal_quality_is_the_best_and_so_the_default(outcome):
    """Spread of the areas over 20 seeds: 0.01 and 0.03, the gaps are 0.1."""
    areas = [outcome.row(f'{test}, area under the curve').measured.mean for test in TESTS]
    assert outcome.holds
    assert areas == sorted(areas, reverse=True)
    assert min(areas) > 0.7


def test_every_kind_of_thing_blocks():
    """A fifth to a third of all ranges, so that the curves rest on hundreds of both kinds."""
    blocked, scores = judged(100)
    assert 0.2 < blocked.mean() < 0.35
    assert all(len(score) == len(blocked) for score in scores.values())
