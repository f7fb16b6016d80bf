"""The localiser as a whole: refusals, restarts, being lost, and states that tell the truth."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.estimation import ESTIMATORS, Localizer, LocalizerConfig, LocalizerState
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, OdometrySample, PoseSample, RangeSample

SECOND = 1_000_000_000
CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1), initial_pose=(4.0, 3.0, 0.8))


def in_time(drive):
    both = [*drive.odometry, *drive.ranges]
    return sorted(both, key=lambda s: (s.stamp, not isinstance(s, OdometrySample)))


def feed(localizer, samples):
    outcomes = []
    for sample in samples:
        if isinstance(sample, OdometrySample):
            outcomes.append(localizer.add_odometry(sample))
        else:
            outcomes.append(localizer.add_range(sample))
    return outcomes


def reasons(outcome):
    return [item.reason for item in outcome.refusals]


@pytest.fixture
def tracking(room):
    """Return a localiser that has tracked for five seconds, and its drive."""
    drive = room.drive(1, seconds=5.0)
    localizer = Localizer(CONFIG, room.anchors)
    feed(localizer, in_time(drive))
    return localizer, drive


def test_tracking_follows_the_truth(room):
    """After twenty seconds the pose is right to a few centimetres, whatever the seed."""
    for seed in range(5):
        drive = room.drive(seed)
        localizer = Localizer(CONFIG, room.anchors)
        feed(localizer, in_time(drive))
        pose, truth = localizer.estimate.pose, drive.truth[localizer.estimate.stamp]
        assert pose.distance_to(truth) < 0.08
        assert localizer.status.trusted


def test_scale_and_gyro_bias_are_learned(room):
    """Odometry 2 % short and drifting by 0.01 rad/s is seen through."""
    errors = []
    for seed in range(5):
        drive = room.drive(seed, seconds=60.0, scale=0.02, drift=0.01, noise=0.05)
        localizer = Localizer(CONFIG, room.anchors)
        feed(localizer, in_time(drive))
        state = dict(zip(localizer.state_names, localizer.estimate.mean, strict=True))
        errors.append((state['scale'] - 0.02, state['gyro_bias'] - 0.01))
    assert np.abs(np.mean(errors, axis=0)) == pytest.approx([0.0, 0.0], abs=3e-3)


def test_map_to_odom_joins_estimate_and_odometry(tracking):
    """The chain map -> odom -> base_link is the estimate."""
    localizer, drive = tracking
    joined = localizer.map_to_odom @ drive.odometry[-1].pose
    assert joined.distance_to(localizer.estimate.pose) < 1e-9


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'stamp': 0}, 'zero stamp'),
        ({'stamp': 60 * SECOND}, 'ahead of odometry'),
        ({'stamp': 3 * SECOND}, 'older than the history'),
        ({'range_m': math.nan}, 'range not finite'),
        ({'range_m': math.inf}, 'range not finite'),
        ({'range_m': -1.0}, 'negative range'),
        ({'range_m': 0.0}, 'negative range'),
        ({'anchor_id': 'B1'}, 'unknown anchor'),
        ({'variance_m2': -0.01}, 'variance not positive'),
        ({'variance_m2': math.nan}, 'variance not positive'),
        ({'variance_m2': math.inf}, 'variance not positive'),
        ({'variance_m2': 1e-13}, 'variance too small'),
        ({'variance_m2': 1e11}, 'variance too large'),
        ({'range_m': 2e5}, 'too far away'),
        ({'nlos_probability': 1.5}, 'nlos probability outside 0 to 1'),
    ],
)
def test_add_range_bad_sample_is_refused_with_reason(tracking, changes, words):
    """Each fault of a range has its own words and leaves the estimate alone."""
    localizer, drive = tracking
    before = localizer.estimate
    good = RangeSample(drive.odometry[-1].stamp - 5_000_000, 'A0', 'tag', 0, 5.0, 0.01)
    assert reasons(localizer.add_range(replace(good, **changes))) == [words]
    assert localizer.estimate is before


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'stamp': 0}, 'zero stamp'),
        ({'pose': Pose2(math.nan, 0, 0)}, 'not finite'),
        ({'linear_m_s': math.inf}, 'not finite'),
        ({'stamp': 3 * SECOND}, 'older than the history'),
        ({'pose': Pose2(30.0, 0.0, 0.0)}, 'odometry jump'),
        ({'pose': Pose2(0.0, -2e5, 0.0)}, 'too far away'),
        ({'linear_m_s': -3.1}, 'velocity too high'),
        ({'angular_rad_s': 11.0}, 'velocity too high'),
    ],
)
def test_add_odometry_bad_sample_is_refused_with_reason(tracking, changes, words):
    """Each fault of odometry has its own words."""
    localizer, drive = tracking
    good = replace(drive.odometry[-1], stamp=drive.odometry[-1].stamp + 20_000_000)
    assert reasons(localizer.add_odometry(replace(good, **changes))) == [words]
    assert not localizer.add_odometry(good).refusals
    assert reasons(localizer.add_odometry(good)) == ['repeated']


@pytest.mark.parametrize(
    ('pose', 'covariance', 'words'),
    [
        (Pose2(math.nan, 1.0, 0.0), np.eye(3), 'pose not finite'),
        (Pose2(), np.diag([1.0, np.nan, 1.0]), 'covariance not finite'),
        (Pose2(), np.diag([1.0, 0.0, 1.0]), 'variance not positive'),
        (Pose2(), np.diag([1.0, -1.0, 1.0]), 'variance not positive'),
        (Pose2(), np.diag([1.0, 1.0, np.inf]), 'heading missing'),
        (Pose2(), np.eye(3) + np.triu(np.full((3, 3), 0.1), 1), 'covariance not symmetric'),
        (Pose2(), np.full((3, 3), 2.0) - np.eye(3), 'covariance not positive semi-definite'),
        (Pose2(), np.ones((3, 3)), 'covariance singular'),
        (Pose2(), np.diag([1.0, 1e-13, 1.0]), 'variance too small'),
        (Pose2(), np.diag([1e11, 1.0, 1.0]), 'variance too large'),
        (Pose2(1e6, 0.0, 0.0), np.eye(3), 'too far away'),
    ],
)
def test_set_pose_malformed_is_refused_with_reason(tracking, pose, covariance, words):
    """A pose that is no pose is refused and nothing changes."""
    localizer, drive = tracking
    before = localizer.estimate
    sample = PoseSample(drive.odometry[-1].stamp, pose, covariance, 'initialpose')
    assert reasons(localizer.set_pose(sample)) == [words]
    assert localizer.estimate is before


def test_set_pose_overrides_what_was_believed(tracking):
    """The estimate is where the user says, at once."""
    localizer, drive = tracking
    sample = PoseSample(drive.odometry[-1].stamp, Pose2(1.0, 2.0, -3.0), np.eye(3) * 0.04, 'rviz')
    outcome = localizer.set_pose(sample)
    assert outcome.estimate.mean[:3] == pytest.approx([1.0, 2.0, -3.0])


def test_set_pose_before_odometry_waits_for_it(room):
    """A pose that comes first is kept for the first odometry."""
    localizer = Localizer(CONFIG.replace(initial_pose=()), room.anchors)
    drive = room.drive(1, seconds=0.2)
    given = PoseSample(drive.odometry[0].stamp, Pose2(1.0, 2.0, 0.3), np.eye(3) * 0.04, 'rviz')
    assert localizer.set_pose(given).estimate is None
    assert localizer.add_odometry(drive.odometry[0]).estimate.mean[:3] == pytest.approx(
        [1.0, 2.0, 0.3]
    )


def test_set_pose_before_odometry_of_another_epoch_counts_at_the_first_odometry(room):
    """A stamp long before or after the first odometry neither raises nor stops the clock."""
    for stamp in (1, 10**18):
        localizer = Localizer(CONFIG.replace(initial_pose=()), room.anchors)
        drive = room.drive(1, seconds=0.2)
        localizer.set_pose(PoseSample(stamp, Pose2(1.0, 2.0, 0.3), np.eye(3) * 0.04, 'rviz'))
        feed(localizer, in_time(drive))
        assert localizer.estimate.stamp == drive.odometry[-1].stamp
        assert localizer.status.state is LocalizerState.TRACKING


@pytest.mark.parametrize('name', sorted(ESTIMATORS))
def test_estimator_changed_at_run_time_keeps_the_pose(tracking, room, name):
    """Another estimator goes on from the pose and the covariance of the one before it."""
    localizer, drive = tracking
    before = localizer.estimate
    localizer.configure(CONFIG.replace(estimator=name))
    after = localizer.estimate
    assert after.pose == before.pose
    assert after.pose_covariance.diagonal() == pytest.approx(before.pose_covariance.diagonal())
    assert (
        localizer.state_names
        == ESTIMATORS[name](CONFIG.filter, room.anchors, (-0.1, 0.05, 1.1)).state_names
    )
    localizer.add_odometry(
        replace(drive.odometry[-1], stamp=drive.odometry[-1].stamp + 20_000_000)
    )
    assert localizer.estimate.pose.distance_to(before.pose) < 0.02
    localizer.configure(CONFIG.replace(estimator=name, lost_window=2.0))
    assert localizer.starts == 1 + (name != 'ekf')  # settings alone begin nothing


def test_silent_ranges_let_the_covariance_grow_and_are_told(room):
    """Without ranges the pose goes on by odometry and owns up to its age."""
    drive = room.drive(1, seconds=20.0)
    localizer = Localizer(CONFIG, room.anchors)
    feed(localizer, [s for s in in_time(drive) if s.stamp < 6 * SECOND])
    early = np.trace(localizer.estimate.pose_covariance[:2, :2])
    feed(localizer, [s for s in drive.odometry if s.stamp >= 6 * SECOND])
    assert np.trace(localizer.estimate.pose_covariance[:2, :2]) > 2 * early
    assert localizer.status.dead_reckoning_s == pytest.approx(15.0, abs=0.2)
    assert localizer.status.words == 'dead reckoning: no measurements, for 15.0 s'


def test_silent_odometry_stops_the_estimate(tracking):
    """Ranges alone do not carry the pose on: beyond 0.2 s they are refused."""
    localizer, drive = tracking
    end = drive.odometry[-1].stamp
    outcomes = [
        localizer.add_range(RangeSample(end + k * 25_000_000, f'A{k % 4}', 'tag', k, 6.0, 0.01))
        for k in range(1, 40)
    ]
    assert reasons(outcomes[-1]) == ['ahead of odometry']
    assert localizer.estimate.stamp <= end + 200_000_000


def test_kidnapped_robot_is_lost_then_found_again(room):
    """Carried off, the robot says so within the window and finds itself by driving on."""
    for seed in range(5):
        here = room.drive(seed, seconds=6.0)
        there = room.drive(seed + 50, seconds=25.0, start=Pose2(8.5, 6.0, -2.2))
        localizer = Localizer(CONFIG, room.anchors)
        feed(localizer, in_time(here))
        carried = here.odometry[-1]
        shift = carried.stamp - SECOND
        lost_at = found_at = None
        truth = {stamp + shift: pose for stamp, pose in there.truth.items()}
        for sample in in_time(there):
            moved = replace(sample, stamp=sample.stamp + shift)
            if isinstance(moved, OdometrySample):
                moved = replace(moved, pose=carried.pose @ moved.pose)
            feed(localizer, [moved])
            state = localizer.status.state
            if state is LocalizerState.LOST and lost_at is None:
                lost_at = moved.stamp
                assert not localizer.status.trusted
                assert localizer.map_to_odom is None
            if lost_at and state is LocalizerState.TRACKING and found_at is None:
                found_at = moved.stamp
        assert lost_at - carried.stamp < 4 * SECOND
        assert (found_at - lost_at) * 1e-9 * 0.5 < 5.0  # metres of driving
        pose, end = localizer.estimate.pose, truth[localizer.estimate.stamp]
        assert pose.distance_to(end) < 0.15
        assert abs(difference(pose.heading, end.heading)) < 0.1


def test_odometry_from_another_origin_keeps_the_pose(tracking):
    """A restarted odom_node begins at zero; the pose in the map goes on."""
    localizer, drive = tracking
    before, last = localizer.estimate.pose, drive.odometry[-1]
    away = [
        OdometrySample(last.stamp + k * 20_000_000, Pose2(50.0, 50.0, 2.0), 0.0, 0.0)
        for k in (1, 2, 3)
    ]
    results = feed(localizer, away)
    assert reasons(results[0]) == ['odometry jump']
    assert reasons(results[1]) == ['odometry started from another origin']
    assert not results[2].refusals
    assert localizer.estimate.pose.distance_to(before) < 0.05


def test_restarted_streams_begin_anew(room):
    """A bag played again from its start is followed again, from the configured pose."""
    drive = room.drive(1, seconds=8.0)
    localizer = Localizer(CONFIG, room.anchors)
    feed(localizer, in_time(drive))
    outcomes = feed(localizer, in_time(drive))
    assert 'time went back: started again' in [r for item in outcomes for r in reasons(item)]
    truth = drive.truth[localizer.estimate.stamp]
    assert localizer.estimate.stamp == drive.odometry[-1].stamp
    assert localizer.estimate.pose.distance_to(truth) < 0.15


def test_changed_anchors_keep_the_pose(tracking, room):
    """New anchor positions at run time go on from the same pose."""
    localizer, _ = tracking
    before = localizer.estimate.pose
    localizer.set_anchors((*room.anchors, Anchor('A9', (6.0, 9.0, 2.25))))
    assert localizer.estimate.pose == before
    assert 'range_bias.A9' in localizer.state_names


def test_same_input_twice_gives_the_same_bits(room):
    """Two runs agree to the last bit."""
    drive = room.drive(9, seconds=10.0)
    one, two = (Localizer(CONFIG.replace(initial_pose=()), room.anchors) for _ in range(2))
    feed(one, in_time(drive))
    feed(two, in_time(drive))
    assert np.array_equal(one.estimate.mean, two.estimate.mean)
    assert np.array_equal(one.estimate.covariance, two.estimate.covariance)


@pytest.mark.parametrize('name', sorted(ESTIMATORS))
def test_every_estimator_runs_behind_the_same_interface(room, name):
    """Each estimator that can be chosen follows exact odometry and reports every range."""
    drive = room.drive(2, seconds=5.0)
    localizer = Localizer(CONFIG.replace(estimator=name), room.anchors)
    outcomes = feed(localizer, in_time(drive))
    pose, truth = localizer.estimate.pose, drive.truth[localizer.estimate.stamp]
    assert pose.distance_to(truth) < 0.1
    innovations = [one for outcome in outcomes for one in outcome.innovations]
    if ESTIMATORS[name].takes_positions:
        # Four ranges at 25 Hz make one fix; the last may still be gathered.
        assert len(drive.ranges) // 4 - 1 <= len(innovations) <= len(drive.ranges) // 4
    else:
        assert len(innovations) == len(drive.ranges)
    if name == 'dead_reckoning':
        assert not any(one.accepted for one in innovations)
        assert innovations[0].reason == 'dead reckoning takes no measurements'


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'estimator': 'magic'}, 'estimator.*one of'),
        ({'initial_pose': (1.0, 2.0)}, 'initial_pose'),
        ({'tag_position': (1.0,)}, 'tag_position'),
        ({'history': -1.0}, 'history'),
    ],
)
def test_config_bad_value_is_named(changes, words):
    """Settings that cannot be used are named."""
    with pytest.raises(ConfigError, match=words):
        CONFIG.replace(**changes)
