"""Late data in place equal on-time data, to the last bit."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, PoseSample

CONFIG = LocalizerConfig(
    tag_position=(-0.1, 0.05, 1.1),
    initial_pose=(4.0, 3.0, 0.8),
    initial_pose_std=(0.1, 0.1, 0.1),
)


def feed(localizer, sample):
    if isinstance(sample, OdometrySample):
        return localizer.add_odometry(sample)
    if isinstance(sample, PoseSample):
        return localizer.add_pose(sample)
    return localizer.add_range(sample)


def run(room, samples):
    localizer = Localizer(CONFIG, room.anchors)
    refused = 0
    for sample in samples:
        refused += len(feed(localizer, sample).refusals)
    return localizer, refused


def in_time(drive):
    """Return all samples by stamp; odometry before the range of the same instant."""
    both = [*drive.odometry, *drive.ranges]
    return sorted(both, key=lambda s: (s.stamp, not isinstance(s, OdometrySample)))


def assert_equal(one, other):
    assert one.estimate.stamp == other.estimate.stamp
    assert np.array_equal(one.estimate.mean, other.estimate.mean)
    assert np.array_equal(one.estimate.covariance, other.estimate.covariance)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 0.5))
def test_ranges_late_by_up_to_half_a_second_change_nothing(room, seed, delay):
    """Ranges shuffled by delays of up to 0.5 s end in the same bits as in order."""
    drive = room.drive(3, seconds=4.0)
    samples = in_time(drive)
    rng = np.random.default_rng(seed)
    late = [
        s.stamp if isinstance(s, OdometrySample) else s.stamp + rng.uniform(0, delay) * 1e9
        for s in samples
    ]
    shuffled = [samples[k] for k in np.argsort(late, kind='stable')]
    on_time, none = run(room, samples)
    delayed, refused = run(room, shuffled)
    assert none == refused == 0
    assert_equal(on_time, delayed)


def with_poses(drive, seed, every=13):
    """Return the samples of a drive in order, with poses of a camera and fixes of UWB among them.

    Some stand at the stamp of an odometry sample, some between two.
    """
    rng = np.random.default_rng(seed)
    poses = []
    for count, stamp in enumerate(sorted(drive.truth)[5::every]):
        true = drive.truth[stamp]
        source, heading = ('camera/pose', 1e-3) if count % 2 else ('uwb/pose', np.inf)
        dx, dy, turn = rng.normal(0, 0.05, 3)
        seen = Pose2(true.x + dx, true.y + dy, true.heading + turn)
        covariance = np.diag([2.5e-3, 2.5e-3, heading])
        poses.append(PoseSample(stamp + 3_000_000 * (count % 3), seen, covariance, source))
    both = [*in_time(drive), *poses]
    return sorted(both, key=lambda s: (s.stamp, not isinstance(s, OdometrySample)))


@pytest.mark.parametrize('estimator', ['ekf', 'ukf', 'ekf_cv'])
@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 10**6), st.floats(0.0, 0.5))
def test_late_early_and_repeated_data_of_all_kinds_change_nothing(room, estimator, seed, delay):
    """Ranges and poses up to 0.5 s late or 0.1 s before their odometry, some of them twice.

    Each repetition is refused as such; all else is used and ends in the same bits as in order.
    """
    rng = np.random.default_rng(seed)
    samples = with_poses(room.drive(8, seconds=2.5), 1)
    config = CONFIG.replace(estimator=estimator)
    reference = Localizer(config, room.anchors)
    for sample in samples:
        assert not feed(reference, sample).refusals
    arrivals = []
    for sample in samples:
        if isinstance(sample, OdometrySample):
            arrivals.append((sample.stamp, sample, False))
            continue
        # Nothing has a place before the first odometry, nor before the start stands.
        early = 0.1 * (sample.stamp > 1_200_000_000)
        at = sample.stamp + rng.uniform(-early, max(delay, 1e-3)) * 1e9
        arrivals.append((at, sample, False))
        if rng.uniform() < 0.2:
            arrivals.append((at + rng.uniform(0, 0.3) * 1e9, sample, True))
    arrivals.sort(key=lambda item: item[0])
    localizer = Localizer(config, room.anchors)
    for _, sample, again in arrivals:
        reasons = [item.reason for item in feed(localizer, sample).refusals]
        assert reasons == (['repeated'] if again else [])
    assert_equal(reference, localizer)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_odometry_late_changes_nothing(room, seed):
    """Odometry that arrives out of order (after later odometry and ranges) ends the same too."""
    drive = room.drive(4, seconds=3.0)
    samples = in_time(drive)
    rng = np.random.default_rng(seed)
    late = [
        s.stamp + (rng.uniform(0, 0.15) * 1e9 if s.stamp > 1_100_000_000 else 0) for s in samples
    ]
    shuffled = [samples[k] for k in np.argsort(late, kind='stable')]
    on_time, _ = run(room, samples)
    delayed, refused = run(room, shuffled)
    assert refused == 0
    assert_equal(on_time, delayed)


def test_range_ahead_of_odometry_is_taken_at_once_and_corrected(room):
    """A range between two odometry stamps moves the estimate before the second one is there."""
    drive = room.drive(5, seconds=2.0)
    localizer, _ = run(room, drive.odometry[:50])
    before = localizer.estimate
    early = next(s for s in drive.ranges if s.stamp > before.stamp)
    outcome = localizer.add_range(early)
    assert outcome.estimate.stamp == early.stamp
    assert not np.array_equal(outcome.estimate.mean, before.mean)
    assert len(outcome.innovations) == 1
    for sample in drive.odometry[50:]:
        localizer.add_odometry(sample)
    ordered = [*drive.odometry[:51], early, *drive.odometry[51:]]
    reference, _ = run(room, ordered)
    assert_equal(localizer, reference)


@pytest.mark.parametrize(
    ('shift_s', 'words'),
    [(-1.5, 'older than the history'), (1.0, 'ahead of odometry')],
)
def test_range_outside_the_history_is_refused(room, shift_s, words):
    """Too late and too early are told apart, and change nothing."""
    drive = room.drive(6, seconds=3.0)
    localizer, _ = run(room, drive.odometry)
    before = localizer.estimate
    sample = drive.ranges[-1]
    shifted = type(sample)(
        sample.stamp + int(shift_s * 1e9), sample.anchor_id, 'tag', 0, sample.range_m
    )
    outcome = localizer.add_range(shifted)
    assert [item.reason for item in outcome.refusals] == [words]
    assert localizer.estimate is before


def test_same_range_twice_counts_once(room):
    """A duplicate is refused, wherever in the history it belongs."""
    drive = room.drive(7, seconds=2.0)
    samples = in_time(drive)
    localizer, _ = run(room, samples)
    before = localizer.estimate
    outcome = localizer.add_range(drive.ranges[-5])
    assert [item.reason for item in outcome.refusals] == ['repeated']
    assert np.array_equal(localizer.estimate.mean, before.mean)
