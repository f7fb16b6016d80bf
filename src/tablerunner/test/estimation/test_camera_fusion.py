"""The localiser with a ceiling camera, with UWB and with both; either fails for a while."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.estimation import (
    ESTIMATORS,
    Cause,
    EstimatorConfig,
    Localizer,
    LocalizerConfig,
    LocalizerState,
)
from tablerunner.estimation.particles.config import ParticleConfig
from tablerunner.estimation.pose_start import NO_HEADING, POSES_NEEDED
from tablerunner.estimation.registry import STARTS_ANYWHERE
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, PoseSample, RangeSample

SECOND = 1_000_000_000
PLACE_STD, HEADING_STD = 0.007, 0.01
"""As the camera says of itself: more than it is off (docs/camera.md)."""
COVARIANCE = np.diag([PLACE_STD**2, PLACE_STD**2, HEADING_STD**2])
# Few particles: these tests are about what is fused, not about how well particles spread.
FILTER = EstimatorConfig(particles=ParticleConfig(at_start=2000, least=100))
CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1), filter=FILTER)

TAKE_POSES = ('ekf', 'iekf', 'lm_iekf', 'pf', 'pf_ekf', 'pf_iekf', 'pf_uiekf', 'ukf')
PLACES_ONLY = ('ddf', 'ekf_cv', 'kf')


def seen(drive, seed=0, every=5, noise=1.0):
    """Return what a camera at 10 Hz says of a drive; `noise` in deviations that it tells."""
    rng = np.random.default_rng(seed)
    poses = []
    for sample in drive.odometry[::every]:
        truth = drive.truth[sample.stamp]
        off = noise * rng.normal(0.0, (PLACE_STD, PLACE_STD, HEADING_STD))
        pose = Pose2(truth.x + off[0], truth.y + off[1], wrap(truth.heading + off[2]))
        poses.append(PoseSample(sample.stamp, pose, COVARIANCE, 'camera/pose'))
    return poses


def in_time(*streams):
    both = [sample for stream in streams for sample in stream]
    return sorted(both, key=lambda s: (s.stamp, not isinstance(s, OdometrySample)))


def feed(localizer, samples):
    outcomes = []
    for sample in samples:
        if isinstance(sample, OdometrySample):
            outcomes.append(localizer.add_odometry(sample))
        elif isinstance(sample, RangeSample):
            outcomes.append(localizer.add_range(sample))
        else:
            outcomes.append(localizer.add_pose(sample))
    return outcomes


def off(localizer, truth):
    """Return how far the pose is off [m, rad]."""
    pose, true = localizer.estimate.pose, truth[localizer.estimate.stamp]
    return pose.distance_to(true), abs(wrap(pose.heading - true.heading))


def until(samples, stamp):
    """Return what comes before a stamp, an odometry sample last: there is a truth at its stamp."""
    last = max(s.stamp for s in samples if isinstance(s, OdometrySample) and s.stamp < stamp)
    return [s for s in samples if s.stamp <= last]


def reasons(outcomes):
    return [item.reason for outcome in outcomes for item in outcome.refusals]


@pytest.fixture(scope='module')
def drive(room):
    """Return 15 s of driving, ten of which a source will miss; a round of ranges every 0.48 s."""
    drive = room.drive(3, seconds=15.0, noise=0.05)
    rounds = [s for index, s in enumerate(drive.ranges) if index // 4 % 3 == 0]
    return replace(drive, ranges=rounds)


@pytest.mark.parametrize('estimator', sorted(ESTIMATORS))
def test_every_estimator_starts_by_poses_without_anchors(room, estimator):
    """Three poses of the camera, no anchors: tracking within 0.3 s, at the pose."""
    drive = room.drive(1, seconds=0.4)
    localizer = Localizer(CONFIG.replace(estimator=estimator))
    assert localizer.status.words == 'no anchors yet'
    feed(localizer, in_time(drive.odometry[:1], seen(drive)[:1]))
    assert localizer.status.state is LocalizerState.ALIGNING
    assert localizer.status.words == '1 of 3 poses that agree'
    feed(localizer, in_time(drive.odometry[1:], seen(drive)[1:POSES_NEEDED]))
    assert localizer.status.state is LocalizerState.TRACKING
    place, heading = off(localizer, drive.truth)
    assert place < 4 * PLACE_STD
    assert heading < 4 * HEADING_STD


@pytest.mark.parametrize('source', ['camera', 'UWB', 'both'])
@pytest.mark.parametrize('estimator', TAKE_POSES)
def test_sources_carry_the_pose_from_an_unknown_start(drive, room, estimator, source):
    """Camera only (no anchors at all), both: found, and right at the end; UWB only: right.

    What finds a start by ranges alone is tested in test_alignment.py and test_robot.py.
    """
    anchors = () if source == 'camera' else room.anchors
    streams = [drive.odometry]
    streams += [seen(drive)] if source != 'UWB' else []
    streams += [drive.ranges] if source != 'camera' else []
    given = (4.0, 3.0, 0.8) if source == 'UWB' else ()
    localizer = Localizer(CONFIG.replace(estimator=estimator, initial_pose=given), anchors)
    feed(localizer, until(in_time(*streams), 4 * SECOND))
    place, heading = off(localizer, drive.truth)
    # Ranges of 5 cm: learned biases and all, centimetres; a camera of 7 mm: below two of them.
    assert place < (0.12 if source == 'UWB' else 0.015)
    assert heading < (0.08 if source == 'UWB' else 0.015)
    assert localizer.status.cause is Cause.FUSED
    # Particles that begin anywhere, by ranges, count as a start of their own.
    assert localizer.starts == 1 + (source == 'both' and estimator in STARTS_ANYWHERE)


@pytest.mark.parametrize('failing', ['camera', 'UWB', 'camera alone', 'UWB alone'])
@pytest.mark.parametrize('estimator', TAKE_POSES)
def test_a_source_fails_for_ten_seconds(drive, room, estimator, failing):
    """From 3 s to 13 s one source is silent: the other carries on, or odometry does and says so.

    Odometry is exact here: what is off is what the last measurements left.
    """
    down = (3 * SECOND, 13 * SECOND)
    poses, ranges = seen(drive), drive.ranges
    if failing in ('camera', 'camera alone'):
        poses = [s for s in poses if not down[0] <= s.stamp < down[1]]
    else:
        ranges = [s for s in ranges if not down[0] <= s.stamp < down[1]]
    alone = failing.endswith('alone')
    streams = [drive.odometry]
    streams += [poses] if failing != 'UWB alone' else []
    streams += [ranges] if failing != 'camera alone' else []
    config = CONFIG.replace(estimator=estimator, initial_pose=(4.0, 3.0, 0.8))
    localizer = Localizer(config, () if failing == 'camera alone' else room.anchors)
    samples = in_time(*streams)
    feed(localizer, until(samples, down[1]))
    place, heading = off(localizer, drive.truth)
    assert localizer.status.cause is (Cause.SILENT if alone else Cause.FUSED)
    assert localizer.status.trusted
    with_camera = failing == 'UWB'
    assert place < (0.02 if with_camera else 0.3)
    assert heading < (0.02 if with_camera else 0.12)
    outcomes = feed(localizer, samples[len(until(samples, down[1])) :])
    taken = [one.accepted for outcome in outcomes for one in outcome.innovations]
    assert np.mean(taken) > 0.95
    place, heading = off(localizer, drive.truth)
    assert place < (0.15 if failing == 'UWB alone' else 0.02)
    assert localizer.status.cause is Cause.FUSED
    assert localizer.starts == 1


@pytest.mark.parametrize('estimator', PLACES_ONLY)
def test_estimators_of_positions_take_the_place_and_leave_the_heading(room, estimator):
    """A camera that says a heading wrong by 0.1 rad: the heading stays odometry's."""
    drive = room.drive(2, seconds=5.0)
    poses = [
        replace(s, pose=Pose2(s.pose.x, s.pose.y, wrap(s.pose.heading + 0.1))) for s in seen(drive)
    ]
    config = CONFIG.replace(estimator=estimator, initial_pose=(4.2, 2.9, 0.8))
    localizer = Localizer(config)
    outcomes = feed(localizer, in_time(drive.odometry, poses))
    place, heading = off(localizer, drive.truth)
    assert heading < 0.05
    taken = [one for outcome in outcomes for one in outcome.innovations if one.accepted]
    assert {len(one.innovation) for one in taken} <= {1, 2}
    if estimator == 'ddf':
        # It corrects across a straight way, and where it turns on the spot; not in curves.
        words = {one.reason for outcome in outcomes for one in outcome.innovations}
        assert 'neither straight on nor in a turn' in words
    else:
        assert len(taken) == len(poses) - 1  # the first is at the stamp of the start
        assert place < 0.15  # from 0.22 m


def test_dead_reckoning_is_started_by_poses_and_refuses_them_after(room):
    drive = room.drive(2, seconds=2.0)
    localizer = Localizer(CONFIG.replace(estimator='dead_reckoning'))
    outcomes = feed(localizer, in_time(drive.odometry, seen(drive)))
    found = [one for outcome in outcomes for one in outcome.innovations]
    assert len(found) == len(seen(drive)) - POSES_NEEDED
    assert {one.reason for one in found} == {'dead reckoning takes no measurements'}
    assert localizer.status.cause is Cause.CHOSEN


@pytest.mark.parametrize('estimator', sorted(ESTIMATORS))
def test_a_given_pose_begins_without_anchors_and_odometry_carries_it(room, estimator):
    drive = room.drive(1, seconds=2.0)
    localizer = Localizer(CONFIG.replace(estimator=estimator, initial_pose=(4.0, 3.0, 0.8)))
    outcomes = feed(localizer, in_time(drive.odometry, drive.ranges[:4]))
    assert set(reasons(outcomes)) == {'unknown anchor'}
    assert localizer.status.trusted
    assert localizer.status.cause in (Cause.SILENT, Cause.CHOSEN)
    assert off(localizer, drive.truth)[0] < 0.02


@pytest.mark.parametrize('estimator', ['pf', 'pf_uiekf'])
def test_one_false_marker_draws_no_particles(room, estimator):
    """Particles all over the room; the first pose is of something else, three right ones not."""
    drive = room.drive(1, seconds=1.0)
    false, *right = seen(drive)[:4]
    false = replace(false, pose=Pose2(9.0, 7.0, -2.0))
    localizer = Localizer(CONFIG.replace(estimator=estimator), room.anchors)
    samples = in_time(drive.odometry, [false, *right])
    for sample in samples[: samples.index(right[-1])]:
        feed(localizer, [sample])
        assert not localizer.status.trusted
    feed(localizer, samples[samples.index(right[-1]) :])
    assert localizer.status.trusted
    assert off(localizer, drive.truth)[0] < 0.03


@pytest.mark.parametrize('estimator', ['ekf', 'pf_uiekf'])
def test_a_carried_robot_is_found_again_by_the_camera(room, estimator):
    """No anchors: lost within the window, found three poses later, whatever the seed."""
    for seed in range(3):
        here = room.drive(seed, seconds=4.0)
        there = room.drive(seed + 50, seconds=4.0, start=Pose2(8.5, 6.0, -2.2))
        localizer = Localizer(CONFIG.replace(estimator=estimator))
        feed(localizer, in_time(here.odometry, seen(here, seed)))
        carried = here.odometry[-1]
        shift = carried.stamp - SECOND
        lost_at = found_at = None
        for sample in in_time(there.odometry, seen(there, seed)):
            moved = replace(sample, stamp=sample.stamp + shift)
            if isinstance(moved, OdometrySample):
                moved = replace(moved, pose=carried.pose @ moved.pose)
            feed(localizer, [moved])
            state = localizer.status.state
            if state is LocalizerState.LOST and lost_at is None:
                lost_at = moved.stamp
            if lost_at and state is LocalizerState.TRACKING and found_at is None:
                found_at = moved.stamp
        assert lost_at - carried.stamp < 2 * SECOND
        assert found_at - lost_at <= 0.3 * SECOND
        truth = {stamp + shift: pose for stamp, pose in there.truth.items()}
        place, heading = off(localizer, truth)
        assert place < 0.02
        assert heading < 0.02


def test_slip_that_ranges_told_is_forgotten_when_they_fall_silent(room):
    """Wheels spin on the spot, then UWB goes: with the camera alone the pose is fused again."""
    drive = room.drive(1, seconds=3.0, still=99.0, noise=0.02)
    odometry, spun = [], 0.0
    for sample in drive.odometry:
        spun += 0.5 * 0.02
        odometry.append(replace(sample, pose=Pose2(spun, 0.0, 0.0), linear_m_s=0.5))
    config = CONFIG.replace(initial_pose=(4.0, 3.0, 0.8))
    localizer = Localizer(config, room.anchors)
    feed(localizer, in_time(odometry, drive.ranges))
    assert localizer.status.cause is Cause.SLIP
    last = odometry[-1]
    still = [
        replace(last, stamp=last.stamp + k * 20_000_000, linear_m_s=0.0) for k in range(1, 100)
    ]
    poses = [
        PoseSample(s.stamp, Pose2(4.0, 3.0, 0.8), COVARIANCE, 'camera/pose') for s in still[::5]
    ]
    feed(localizer, in_time(still, poses))
    assert localizer.status.cause is Cause.FUSED


def test_poses_without_heading_wait_for_it(room):
    """A single disc that stands: its place starts nothing, and the reason is told."""
    drive = room.drive(1, seconds=1.0)
    poses = [replace(s, covariance=np.diag([1e-4, 1e-4, math.inf])) for s in seen(drive)]
    localizer = Localizer(CONFIG)
    assert set(reasons(feed(localizer, in_time(drive.odometry, poses)))) == {NO_HEADING}
    assert localizer.status.words == 'heading unknown: drive'
    assert localizer.estimate is None


def test_anchors_that_come_after_the_camera_keep_the_pose(room):
    drive = room.drive(1, seconds=2.0)
    localizer = Localizer(CONFIG)
    feed(localizer, in_time(drive.odometry, seen(drive)))
    before = localizer.estimate.pose
    localizer.set_anchors(room.anchors)
    assert localizer.estimate.pose == before
    assert 'range_bias.A0' in localizer.state_names
