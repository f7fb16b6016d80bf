"""The trajectories of Lv and Jiang, on one seed that the docs do not show."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tablerunner.control.contour import Mode
from tablerunner.experiments import lv_trajectories
from tablerunner.experiments.lv_trajectories import LEAST_ROOMS, one_seed, run_trajectories
from tablerunner.experiments.trap_room import TRAPS


@pytest.fixture(scope='module')
def drives():
    return one_seed(500)


def test_drives_keep_the_bounds(drives) -> None:
    """Issue 5: at most 1.05 times the shortest way without and 1.25 with one obstacle."""
    assert 0.97 < drives.empty.ratio <= 1.05
    assert 0.97 < drives.box.ratio <= 1.25
    assert [trial.room.kind for trial in drives.traps] == list(TRAPS)
    assert all(trial.improved.arrived for trial in drives.traps)
    assert all(trial.improved.mode is Mode.UNREACHABLE for trial in drives.closed)
    assert drives.gap_m > 0.0


def test_few_seeds_drive_more_rooms_each_and_rows_say_what_fails(drives, monkeypatch) -> None:
    """One of two seeds is spoilt: a trap in which the robot was lost, and counted as such."""
    spoilt = replace(
        drives.traps[0], improved=replace(drives.traps[0].improved, mode=Mode.UNREACHABLE)
    )
    runs = [drives, replace(drives, traps=(spoilt, *drives.traps[1:]))]
    asked = []

    def instead(run, seeds, progress):
        asked.append(run.keywords['rooms'] * len(TRAPS) * len(seeds))
        return runs

    monkeypatch.setattr(lv_trajectories, 'run_seeds', instead)
    outcome = run_trajectories([500, 501], lambda done, count: None)
    assert asked == [24]
    assert asked[0] >= LEAST_ROOMS
    row = outcome.row('trap rooms, arrived')
    assert row.measured.mean == pytest.approx(0.875)
    assert not row.holds
    ways = [trial.improved.way_m for trial in drives.traps]
    older = [trial.older.way_m for trial in drives.traps]
    low = min(sum(ways) / sum(older), sum(ways[1:]) / sum(older[1:]))
    assert outcome.row('path improved / older').measured.low == pytest.approx(low)
    assert outcome.row('no obstacle, path / shortest').holds
    assert outcome.row('closed rooms, reported unreachable').measured.mean == 1.0
    assert math.isnan(drives.closed[0].ratio)
