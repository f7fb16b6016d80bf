"""Figures of a comparison, by hand."""

import math

import numpy as np
import pytest

from tablerunner.evaluation.comparison import Comparison, EstimatorRuns

NAN = math.nan


def runs():
    """Two runs of two steps: distances 5 and 1 m, then 2 m and none."""
    errors = np.array([[[3.0, 4.0, 0.1], [0.0, 1.0, 0.1]], [[2.0, 0.0, 0.1], [NAN, NAN, NAN]]])
    deviations = np.where(np.isfinite(errors), 2.0, NAN)
    nees = np.array([[3.0, 6.0], [9.0, NAN]])
    return EstimatorRuns('e', errors, deviations, nees, np.array([[2.0], [NAN]]), np.ones((2, 1)))


def comparison():
    bounds = np.full((2, 2, 3), 0.5)
    return Comparison('room', (4, 5), np.array([0.0, 0.1]), np.array([0.05]), bounds, (runs(),))


def test_errors_are_over_the_steps_with_a_pose():
    item = runs()
    assert item.rmse == pytest.approx(math.sqrt(30.0 / 3.0))
    assert item.mean == pytest.approx(8.0 / 3.0)
    assert item.max == pytest.approx(5.0)
    assert item.heading_rmse == pytest.approx(0.1)
    assert item.believed_rmse == pytest.approx(math.sqrt(8.0))
    assert item.known == 0.75
    np.testing.assert_allclose(item.rmse_of_runs, [math.sqrt(13.0), 2.0])


def test_figures_stand_beside_the_bound():
    made = comparison()
    assert made.bound_rmse == pytest.approx(1.0)
    figures = made.as_json()['estimators'][0]
    assert figures['ratio_to_bound'] == pytest.approx(math.sqrt(10.0))
    assert figures['heading_ratio_to_bound'] == pytest.approx(0.1 / math.sqrt(0.5))
    # Step one: (3 + 9) / 6, step two: 6 / 3.
    assert figures['nees_mean'] == pytest.approx(2.0)
    assert figures['nis_mean'] == pytest.approx(2.0)
    assert made.as_json()['seeds'] == [4, 5]


def test_rows_are_one_for_each_run():
    rows = list(comparison().rows())
    assert [row['seed'] for row in rows] == [4, 5]
    assert rows[0]['rmse_m'] == pytest.approx(math.sqrt(13.0))
    assert rows[1]['nees_mean'] == pytest.approx(3.0)
    assert math.isnan(rows[1]['nis_mean'])
    assert rows[1]['bound_rmse_m'] == pytest.approx(1.0)


def test_estimator_that_never_knew_a_pose_has_no_figures():
    item = runs()
    nothing = np.full_like(item.errors, NAN)
    lost = EstimatorRuns(
        'e', nothing, nothing, np.full((2, 2), NAN), np.full((2, 1), NAN), item.nis_dimensions
    )
    assert math.isnan(lost.rmse)
    assert math.isnan(lost.average_nees.inside)
    assert lost.known == 0.0
