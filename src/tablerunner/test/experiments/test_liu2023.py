"""Liu's corridor, on fewer seeds than the command runs."""

import numpy as np
import pytest

from tablerunner.experiments.liu2023 import (
    PAPER_M,
    STILL_S,
    drive_of,
    fixes_of,
    run_liu2023,
)
from tablerunner.simulation.truth import RangeTruth


@pytest.fixture(scope='module')
def drive():
    return drive_of(100)


@pytest.fixture(scope='module')
def outcome():
    return run_liu2023(range(100, 104), lambda done, count: None)


def test_rows_have_the_papers_figures_raw_rows_first(outcome):
    """UWB and odometer alone, then what is made of them."""
    assert [row.raw for row in outcome.rows] == [True] * 6 + [False] * (len(outcome.rows) - 6)
    assert [row.paper for row in outcome.rows[:3]] == list(PAPER_M['UWB original'])
    assert outcome.row('ddf, max').paper == 0.17
    assert outcome.row('ekf, max').paper is None


def test_rows_hold_as_far_as_four_seeds_can_tell(outcome):
    """Fused rows have wide margins: `ddf` a third of its bounds, `ekf` two thirds.

    The odometer is one robot's whose slips differ: its mean over four seeds spreads by a fifth,
    and the adaptive RMSE (0.141 m over 20) may pass 0.16 m.
    """
    loose = {'odometer, mean': 1.3, 'odometer, max': 1.3, 'UWB adaptive, RMSE': 1.2}
    for row in outcome.rows:
        if row.name in loose:
            slack = loose[row.name]
            assert row.bound.low / slack < row.measured.mean < row.bound.high * slack
        else:
            assert row.holds, row.name
    order = [outcome.row(f'{name}, mean').measured.median for name in ('ekf', 'ukf', 'odometer')]
    assert order == sorted(order)


def test_middle_of_the_corridor_has_two_clear_anchors(drive):
    """And the far end at least three."""
    clear = {'middle': set(), 'end': set()}
    for sample in drive.samples:
        if isinstance(sample, RangeTruth):
            x = float(np.interp(sample.stamp, drive.stamps, drive.poses[:, 0]))
            where = 'middle' if 12.0 < x < 16.0 else 'end' if x > 23.0 else ''
            if where and not sample.blocked_by:
                clear[where].add(sample.anchor_id)
    assert clear['middle'] == {'A0', 'A1'}
    assert clear['end'] >= {'A0', 'A1', 'A2'}


def test_drive_goes_out_and_back_at_the_speed(drive):
    assert np.ptp(drive.poses[:, 0]) == pytest.approx(12.8, abs=0.1)
    assert drive.poses[-1, :2] == pytest.approx(drive.poses[0, :2], abs=0.1)
    lasted = (drive.stamps[-1] - drive.stamps[0]) / 1e9 - STILL_S
    assert 2 * 12.8 / 0.2 < lasted < 2 * 12.8 / 0.2 + 30.0


def test_without_the_test_for_blocked_ranges_the_fix_is_no_better_than_raw(drive):
    """So that it is the test which makes the difference."""
    raw = fixes_of(drive, 'linear', 'none')[1]
    blind = fixes_of(drive, 'two_anchor', 'none')[1]
    truth_y = 6.8
    assert np.mean(np.abs(blind[:, 1] - truth_y)) > 0.5 * np.mean(np.abs(raw[:, 1] - truth_y))
