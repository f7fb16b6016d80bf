"""The benchmark of PF-UIEKF, on fewer seeds than the command runs."""

import numpy as np
import pytest

from tablerunner.estimation.particles.growth_model import GrowthModel
from tablerunner.experiments.pf_uiekf import FILTERS, one_run, run_pf_uiekf, simulate

BATCHES = (range(300, 306), range(400, 406))


@pytest.fixture(scope='module')
def batches():
    return [[one_run(seed, (20, 200)) for seed in seeds] for seeds in BATCHES]


def mean_rmse(batch, name, count, case=0):
    return np.mean([run[case].runs[name, count].rmse for run in batch])


def test_the_published_order_holds_in_every_batch(batches):
    """PF > PF-EKF > PF-IEKF >= PF-UIEKF with 20 particles."""
    for batch in batches:
        pf, ekf, iekf, uiekf = (mean_rmse(batch, name, 20) for name in FILTERS)
        assert pf > ekf > 5.0 * iekf
        assert uiekf <= 1.001 * iekf
        # The noise of the second half, 0.0032 / 0.5 in x, is what there is to know.
        assert uiekf < 0.0065


def test_more_particles_help_and_the_best_two_meet(batches):
    for batch in batches:
        assert mean_rmse(batch, 'pf', 200) < 0.5 * mean_rmse(batch, 'pf', 20)
        iekf, uiekf = (mean_rmse(batch, name, 200) for name in ('pf_iekf', 'pf_uiekf'))
        assert iekf == pytest.approx(uiekf, rel=0.01)


def test_undamped_runs_away_on_the_sensor_that_saturates(batches):
    for batch in batches:
        worse = {name: np.mean([run[1].runs[name, 20].worse for run in batch]) for name in FILTERS}
        assert worse['pf_iekf'] > 0.03
        assert worse['pf_uiekf'] == 0.0
        assert mean_rmse(batch, 'pf_uiekf', 20, 1) < 0.5 * mean_rmse(batch, 'pf_iekf', 20, 1)
        assert mean_rmse(batch, 'pf_uiekf', 20, 1) < mean_rmse(batch, 'pf', 20, 1)


def test_same_seed_same_figures():
    first, again, other = (one_run(seed, (20,))[0] for seed in (7, 7, 8))
    for key, run in first.runs.items():
        assert np.array_equal(run.means, again.runs[key].means)
        assert not np.array_equal(run.means, other.runs[key].means)


def test_the_truth_is_the_papers_model():
    """What is left of the steps is gamma noise: mean 1.5, variance 0.75 (four deviations)."""
    added = []
    for seed in range(40):
        states, measured = simulate(GrowthModel(), np.random.default_rng(seed))
        before = np.concatenate([[1.0], states[:-1, 0]])
        steps = np.arange(1, 61)
        added.append(states[:, 0] - 1.0 - np.sin(0.04 * np.pi * steps) - 0.5 * before)
        expected = np.where(steps <= 30, 0.2 * states[:, 0] ** 2, 0.5 * states[:, 0] - 2.0)
        assert np.abs(measured[:, 0] - expected).max() < 5.0 * np.sqrt(1e-5)
    assert np.mean(added) == pytest.approx(1.5, abs=4.0 * np.sqrt(0.75 / 2400))
    assert np.var(added) == pytest.approx(0.75, abs=0.15)
    assert np.min(added) > 0.0


def test_outcome_holds_and_tells_all_rows():
    outcome = run_pf_uiekf(range(600, 602), lambda done, count: None)
    assert outcome.holds
    figures = outcome.as_figures()
    assert figures['runs'] == 2
    rows = {(row['row'], row['metric']): row for row in figures['rows']}
    for name in ('PF', 'PF-EKF', 'PF-IEKF', 'PF-UIEKF'):
        for count in (20, 50, 200):
            for metric in ('RMSE', 'variance of RMSE', 'time'):
                assert (f'{name}, N = {count}', metric) in rows
    assert rows['PF-UIEKF, N = 50', 'time']['paper'] == 1661.3
