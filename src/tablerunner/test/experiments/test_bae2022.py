"""Bae's tables, on fewer seeds than the command runs."""

import numpy as np
import pytest

from tablerunner.experiments import bae2022
from tablerunner.experiments.bae2022 import METHODS, OURS, PAPER_MM, one_run, run_bae2022


@pytest.fixture(scope='module')
def outcome():
    return run_bae2022(range(100, 103), lambda done, count: None)


def test_raw_rows_come_first_and_every_bound_holds(outcome):
    """Spread over seeds: at most 10 mm, the narrowest margin is 12 mm."""
    assert [row.raw for row in outcome.rows[:3]] == [True, True, False]
    assert sum(row.bound is not None for row in outcome.rows) == 2 * (len(METHODS) + 1)
    assert outcome.holds


@pytest.mark.parametrize('path', PAPER_MM)
def test_published_figures_are_those_of_the_paper(outcome, path):
    assert [outcome.row(f'{path}, {name}').paper for name in METHODS] == list(PAPER_MM[path])


def test_order_of_the_stages_is_the_same_on_every_path(outcome):
    for path in PAPER_MM:
        means = [
            outcome.row(f'{path}, {name}').measured.mean
            for name in ('LS (T)', 'T_C', 'T_R', 'T_F', OURS)
        ]
        assert means == sorted(means, reverse=True)


def test_ranges_have_the_errors_of_table_1():
    rng = np.random.default_rng(1)
    truth = bae2022.circle(20_000)
    errors = bae2022.measure(rng, truth, 1.0) - bae2022.true_ranges(truth, 1.0)
    # Four standard errors of the mean.
    assert errors.mean(axis=0) == pytest.approx(bae2022.BIASES_M, abs=0.0015)
    assert errors.std(axis=0) == pytest.approx(np.full(4, 0.05), abs=0.001)


@pytest.mark.parametrize(('path', 'length'), [(bae2022.square, 20.0), (bae2022.circle, 15.708)])
def test_paths_begin_at_the_side_and_close(path, length):
    points = path(2000)
    assert points[0] == pytest.approx([2.5, 0.0])
    assert points[-1] == pytest.approx(points[0], abs=0.02)
    assert bae2022.length_of(points) == pytest.approx(length, rel=0.01)
    assert np.ptp(points, axis=0) == pytest.approx([5.0, 5.0], abs=0.02)


def test_same_seed_same_errors():
    assert one_run(3, samples=60).errors == one_run(3, samples=60).errors
