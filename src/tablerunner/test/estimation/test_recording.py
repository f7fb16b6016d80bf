"""A recording localiser does what a localiser does, and what it kept is the very run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.estimation.recording import RecordingLocalizer
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, PoseSample, RangeSample


def delayed(drive, rng):
    """Return odometry and ranges in the order in which they come: some ranges up to 0.6 s late."""
    arrivals = [(sample.stamp, sample) for sample in drive.odometry]
    for sample in drive.ranges:
        arrivals.append((sample.stamp + int(rng.choice([0, 0, 1e8, 6e8])), sample))
    return [sample for _, sample in sorted(arrivals, key=lambda item: item[0])]


def give(localizer, sample):
    """Give one sample to a localiser."""
    if isinstance(sample, OdometrySample):
        return localizer.add_odometry(sample)
    if isinstance(sample, RangeSample):
        return localizer.add_range(sample)
    return localizer.set_pose(sample)


def same(one, other):
    """Whether two outcomes are the same to the last bit."""
    if (one.estimate is None) != (other.estimate is None):
        return False
    if one.estimate is not None and (
        one.estimate.stamp != other.estimate.stamp
        or one.estimate.mean.tobytes() != other.estimate.mean.tobytes()
        or one.estimate.covariance.tobytes() != other.estimate.covariance.tobytes()
    ):
        return False
    return one.refusals == other.refusals and [
        (item.stamp, item.accepted, item.nis) for item in one.innovations
    ] == [(item.stamp, item.accepted, item.nis) for item in other.innovations]


@pytest.mark.parametrize('name', ['ekf', 'ukf', 'kf', 'dead_reckoning'])
def test_recording_changes_nothing(room, name):
    """Late data, data too late, a pose given on the way: outcome by outcome, bit by bit."""
    config = LocalizerConfig(name, tag_position=room.lever, history=0.5)
    plain, recording = Localizer(config, room.anchors), RecordingLocalizer(config, room.anchors)
    samples = delayed(room.drive(3, 16.0), np.random.default_rng(0))
    given = PoseSample(0, Pose2(3.0, 3.0, 0.5), np.diag([0.1, 0.1, 0.1]), 'initialpose')
    for row, age in ((800, 3_000_000_000), (900, 100_000_000)):  # too old, then well in time
        samples.insert(row, replace(given, stamp=samples[row].stamp - age))
    refused = 0
    for sample in samples:
        one, other = give(plain, sample), give(recording, sample)
        assert same(one, other)
        refused += len(one.refusals)
    assert plain.status == recording.status
    if name != 'kf':  # it gathers ranges before it looks at how late they are
        assert refused > 20
    assert len(recording.runs()) >= 2  # the pose given was wrong: some notice and begin anew
    # No farther back than the history: what lies before belongs to the first run.
    second = recording.runs()[1]
    assert second.start.stamp - second.lead_in[0].stamp < 700_000_000


def test_recording_keeps_the_run_that_the_filter_ended_with(room):
    """In order of stamps, with every measurement that was taken, and the estimates it led to."""
    config = LocalizerConfig(tag_position=room.lever)
    recording = RecordingLocalizer(config, room.anchors)
    newest, taken = {}, 0
    for sample in delayed(room.drive(4, 16.0), np.random.default_rng(1)):
        outcome = give(recording, sample)
        taken += len(outcome.innovations)
    (run,) = recording.runs()
    stamps = [step.stamp for step in run.steps]
    assert stamps == sorted(stamps)
    assert taken == sum(step.measurement is not None for step in run.steps) > 300
    estimate = run.first
    for step in run.steps:  # no two ranges of this drive are of one instant
        if step.motion is not None:
            estimate = run.estimator.predict(estimate, step.motion, step.stamp)
        if step.measurement is not None:
            estimate, _ = run.estimator.update_ranges(estimate, [step.measurement])
        assert estimate.mean.tobytes() == step.after.mean.tobytes()
        newest[step.stamp] = estimate
    final = recording.estimate
    assert final is not None
    assert final.mean.tobytes() == newest[final.stamp].mean.tobytes()
    # The window that the start was found from lies before it.
    assert run.lead_in[-1].stamp < run.start.stamp
    assert sum(lead.measurement is not None for lead in run.lead_in) >= 12
    total = sum(lead.onward.dt_s for lead in run.lead_in)
    assert total == pytest.approx((run.start.stamp - run.lead_in[0].stamp) * 1e-9)


def test_recording_lost_and_found_are_two_runs(room):
    """What was kept of the first run is still right after the track behind it is gone."""
    config = LocalizerConfig(tag_position=room.lever)
    recording = RecordingLocalizer(config, room.anchors)
    one = room.drive(5, 20.0)
    # Carried off: from there on the ranges are those of another place.
    far = room.drive(6, 60.0, start=Pose2(9.0, 7.0, -2.0))
    for sample in sorted([*one.odometry, *one.ranges], key=lambda item: item.stamp):
        give(recording, sample)
    pose, shift = one.odometry[-1].pose, 20_000_000_000
    for sample in sorted([*far.odometry, *far.ranges], key=lambda item: item.stamp):
        moved = replace(sample, stamp=sample.stamp + shift)
        if isinstance(moved, OdometrySample):
            moved = replace(moved, pose=pose @ sample.pose)
        give(recording, moved)
    first, second = recording.runs()
    assert first.steps[-1].stamp < second.start.stamp
    assert first.lead_in[0].stamp == one.odometry[0].stamp
    found = second.steps[-1].after.pose
    true = far.truth[far.odometry[-1].stamp]
    assert np.hypot(found.x - true.x, found.y - true.y) < 0.3
    # Before it was carried off, the first run followed the first drive.
    steps = {step.stamp: step.after.pose for step in first.steps}
    stamp = one.odometry[-100].stamp
    assert np.hypot(steps[stamp].x - one.truth[stamp].x, steps[stamp].y - one.truth[stamp].y) < 0.3
