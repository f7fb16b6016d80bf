"""The smoothed path of a replay: the real recording, and runs that begin anew."""

from __future__ import annotations

from dataclasses import replace as changed
from pathlib import Path

import numpy as np

from tablerunner.bags.labyrinth import convert_labyrinth
from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import ReplayResult, replay
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.bags.smoothing import smooth_replay, smoothed_errors
from tablerunner.scenario import Scenario, load_scenario

BOUND_LABYRINTH_M = 0.07


def kept(bag: Path, config: ReplayConfig) -> ReplayResult:
    """Replay a bag and keep every step."""
    with BagReader(bag) as reader:
        return replay(reader, changed(config, keep=True))


def test_smoothed_labyrinth_is_better_than_the_filter_and_within_its_bound(
    labyrinth_folder: Path, tmp_path: Path
) -> None:
    """From the first odometry on, though the start is found seconds later."""
    convert_labyrinth(labyrinth_folder, tmp_path / 'bag')
    scenario = load_scenario(tmp_path / 'bag' / 'scenario.yaml')
    result = kept(tmp_path / 'bag', ReplayConfig.from_scenario(scenario))
    smoothed = smoothed_errors(result)
    assert smoothed.stamps[0] == result.truth.stamps[0]
    assert len(smoothed.stamps) == len(result.truth)
    since = result.first_stamp + 5_000_000_000
    late, filtered = smoothed.since(since).summary(), result.errors.since(since).summary()
    assert late.rmse < filtered.rmse
    assert late.rmse <= BOUND_LABYRINTH_M
    assert smoothed.summary().max < result.errors.summary().max


def test_smoothed_path_of_two_runs_is_one_path(simulated_bag: Path, restaurant: Scenario) -> None:
    """The second run is led back to the end of the first, not into it."""
    result = kept(simulated_bag, ReplayConfig.from_scenario(restaurant))
    (run,) = result.runs
    half = len(run.steps) // 2
    # As if the estimator had begun anew half way, its start found from two seconds before.
    first = changed(run, steps=run.steps[: half - 200])
    second = changed(
        run,
        start=changed(run.start, stamp=run.steps[half].stamp),
        first=run.steps[half].after,
        steps=run.steps[half + 1 :],
        lead_in=tuple(
            changed_lead(lead, run.steps[half].stamp - run.start.stamp) for lead in run.lead_in
        ),
    )
    path = smooth_replay(changed(result, runs=(first, second)))
    assert (np.diff(path.stamps) > 0).all()
    alone = smooth_replay(changed(result, runs=(first,)))
    np.testing.assert_array_equal(path.poses[: len(alone.stamps)], alone.poses)
    assert path.stamps[len(alone.stamps)] > alone.stamps[-1]
    assert path.stamps[-1] == run.steps[-1].stamp


def changed_lead(lead, later):
    """Return a lead-in moved in time [ns]."""
    return lead._replace(stamp=lead.stamp + later)
