"""The particle filters of the robot, behind the interface of all estimators."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.estimation import (
    ESTIMATORS,
    EstimatorConfig,
    Localizer,
    LocalizerConfig,
    LocalizerState,
    Start,
)
from tablerunner.estimation.particles.config import ParticleConfig
from tablerunner.estimation.particles.robot import NO_PARTICLE
from tablerunner.estimation.registry import STARTS_ANYWHERE
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import HeadingSample, OdometrySample, PoseSample, RangeSample

NAMES = sorted(STARTS_ANYWHERE)
ALL = pytest.mark.parametrize('name', NAMES)
CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1))


def in_time(drive):
    return sorted([*drive.odometry, *drive.ranges], key=lambda item: item.stamp)


def feed(localizer, samples):
    for sample in samples:
        if isinstance(sample, RangeSample):
            localizer.add_range(sample)
        elif isinstance(sample, PoseSample):
            localizer.add_pose(sample)
        else:
            localizer.add_odometry(sample)


def particles(**changes):
    return EstimatorConfig(particles=ParticleConfig(**changes))


def many_ranges(room, name, count, seed=0, steps=40):
    """Return a filter's estimate and the `ekf`'s on the same ranges, four at a time."""
    config = particles(least=count, at_start=max(count, 4000))
    start = Start(1, np.array([4.2, 2.9, 0.7]), np.diag([0.04, 0.04, 0.02]))
    found = []
    for which in (name, 'ekf'):
        estimator = ESTIMATORS[which](config, room.anchors, room.lever)
        rng = np.random.default_rng(seed)
        estimate, at = estimator.start(start), Pose2(4.0, 3.0, 0.8)
        for k in range(steps):
            motion = Motion(0.05, 0.04 * math.sin(0.2 * k), 0.1)
            at = advance(at, motion)
            estimate = estimator.predict(estimate, motion, k + 2)
            tag = at.transform(np.array(room.lever[:2]))
            samples = [
                RangeSample(
                    k + 2,
                    anchor.anchor_id,
                    'tag',
                    k,
                    math.dist((*tag, room.lever[2]), anchor.position) + rng.normal(0, 0.1),
                    0.01,
                )
                for anchor in room.anchors
            ]
            estimate, _ = estimator.update_ranges(estimate, samples)
        found.append(estimate)
    return found


@ALL
def test_many_particles_agree_with_the_ekf_where_that_is_right(room, name):
    """Ranges from metres away are nearly straight: both posteriors are nearly one.

    1000 particles leave 3 % of a deviation for independent draws; resampling, the kernel and what
    the `ekf` carries besides (a delay, range scales) make a few tenths of it.
    """
    apart, ratio = [], []
    for seed in range(3):
        found, expected = many_ranges(room, name, 1000, seed)
        deviations = np.sqrt(np.diagonal(expected.pose_covariance))
        apart.append((found.mean[:3] - expected.mean[:3]) / deviations)
        ratio.append(np.sqrt(np.diagonal(found.pose_covariance)) / deviations)
    assert np.sqrt(np.mean(np.square(apart))) < 0.4
    assert np.mean(ratio, axis=0) == pytest.approx(np.ones(3), rel=0.3)


@ALL
def test_start_is_found_from_anywhere_and_the_number_adapts(room, name):
    """Position and heading within 2 m of driving from a uniform start; then few particles do."""
    seed = NAMES.index(name)
    drive = room.drive(seed, seconds=4.0, start=Pose2(1.0 + 2.5 * seed, 6.0, 2.1 * seed))
    localizer = Localizer(CONFIG.replace(estimator=name), room.anchors)
    samples = in_time(drive)
    feed(localizer, samples[:1])
    assert localizer.estimate is None
    feed(localizer, samples[1:2])
    assert localizer.estimate is None
    assert localizer.status.state is LocalizerState.ALIGNING
    assert localizer.map_to_odom is None
    feed(localizer, samples[2:])
    assert localizer.status.state is LocalizerState.TRACKING
    estimate = localizer.estimate
    truth = drive.truth[estimate.stamp]
    assert estimate.pose.distance_to(truth) < 0.25
    assert abs(wrap(estimate.pose.heading - truth.heading)) < 0.1
    assert len(estimate.carried) == CONFIG.filter.particles.least


@pytest.mark.parametrize('name', ['pf', 'pf_uiekf'])
def test_data_put_in_place_late_give_the_same_bits(room, name):
    """Ranges up to half a second late, from a start that is known."""
    drive = room.drive(8, seconds=2.0)
    config = CONFIG.replace(estimator=name, initial_pose=(4.0, 3.0, 0.8))
    reference, localizer = (Localizer(config, room.anchors) for _ in range(2))
    feed(reference, in_time(drive))
    rng = np.random.default_rng(1)
    arrivals = [(sample.stamp, sample) for sample in drive.odometry]
    arrivals += [(sample.stamp + rng.uniform(0.0, 0.5e9), sample) for sample in drive.ranges[2:]]
    arrivals += [(sample.stamp, sample) for sample in drive.ranges[:2]]
    feed(localizer, [sample for _, sample in sorted(arrivals, key=lambda item: item[0])])
    one, other = reference.estimate, localizer.estimate
    assert np.array_equal(one.mean, other.mean)
    assert np.array_equal(one.covariance, other.covariance)
    assert np.array_equal(one.carried.poses, other.carried.poses)


def test_belief_is_honest_before_the_heading_is_known(room):
    """A robot that stands: the place is found, the heading stays open; driving finds it."""
    drive = room.drive(1, seconds=5.0, still=3.0)
    localizer = Localizer(CONFIG.replace(estimator='pf_uiekf'), room.anchors)
    outcomes = []
    for sample in in_time(drive):
        feed_one = (
            localizer.add_range if isinstance(sample, RangeSample) else localizer.add_odometry
        )
        outcome = feed_one(sample)
        if outcome.estimate is not None and sample.stamp < 3_900_000_000:
            outcomes.append(outcome.estimate)
            assert localizer.estimate is None
    standing = outcomes[-1]
    assert np.trace(standing.pose_covariance[:2, :2]) < 0.3**2
    assert standing.pose_covariance[2, 2] > 1.0  # of pi^2/3
    assert localizer.status.state is LocalizerState.TRACKING


@pytest.mark.parametrize('name', ['pf', 'pf_uiekf'])
def test_carried_off_it_is_lost_and_finds_itself_again(room, name):
    """Odometry goes on as if nothing had happened; within 4 m (8 s) the pose is right again."""
    first = room.drive(2, seconds=4.0)
    second = room.drive(3, seconds=8.0, start=Pose2(9.0, 6.0, -2.0))
    localizer = Localizer(CONFIG.replace(estimator=name), room.anchors)
    feed(localizer, in_time(first))
    assert localizer.status.state is LocalizerState.TRACKING
    later, at = 4_000_000_000, first.odometry[-1].pose
    states = set()
    for sample in in_time(second):
        moved = replace(sample, stamp=sample.stamp + later)
        if isinstance(sample, OdometrySample):
            moved = replace(moved, pose=at @ sample.pose)
        feed(localizer, [moved])
        states.add(localizer.status.state)
    assert LocalizerState.LOST in states
    assert localizer.status.state is LocalizerState.TRACKING
    estimate = localizer.estimate
    truth = second.truth[estimate.stamp - later]
    assert estimate.pose.distance_to(truth) < 0.2
    assert abs(wrap(estimate.pose.heading - truth.heading)) < 0.1


@pytest.mark.parametrize('name', ['pf', 'pf_uiekf'])
def test_same_inputs_give_the_same_bits_and_another_seed_others(room, name):
    drive = room.drive(4, seconds=1.0)
    found = []
    for seed in (0, 0, 1):
        config = CONFIG.replace(estimator=name, filter=particles(seed=seed))
        localizer = Localizer(config, room.anchors)
        outcomes = []
        for sample in in_time(drive):
            if isinstance(sample, RangeSample):
                outcomes.append(localizer.add_range(sample).estimate.mean)
            else:
                localizer.add_odometry(sample)
        found.append(np.array(outcomes))
    assert np.array_equal(found[0], found[1])
    assert not np.array_equal(found[0], found[2])


@ALL
def test_a_camera_alone_finds_and_carries_the_pose(room, name):
    """Poses without heading, of a marker ahead of the base: heading comes from driving."""
    drive = room.drive(5, seconds=5.0)
    rng = np.random.default_rng(0)
    covariance = np.diag([0.02**2, 0.02**2, np.inf])
    samples = []
    for k, sample in enumerate(drive.odometry):
        samples.append(sample)
        if k % 5 == 0:
            seen = drive.truth[sample.stamp].transform(np.array([0.15, 0.0]))
            place = seen + rng.normal(0.0, 0.02, 2)
            pose = Pose2(float(place[0]), float(place[1]), 0.0)
            samples.append(PoseSample(sample.stamp, pose, covariance, 'camera/pose', (0.15, 0.0)))
    localizer = Localizer(CONFIG.replace(estimator=name), room.anchors)
    feed(localizer, samples)
    estimate = localizer.estimate
    truth = drive.truth[estimate.stamp]
    assert estimate.pose.distance_to(truth) < 0.04
    assert abs(wrap(estimate.pose.heading - truth.heading)) < 0.05


def test_whole_poses_and_headings_correct(room):
    """A pose with heading, then a compass: both pull the heading, across pi too."""
    estimator = ESTIMATORS['pf_uiekf'](CONFIG.filter, room.anchors, room.lever)
    estimate = estimator.start(Start(1, np.array([4.0, 3.0, 3.1]), np.diag([0.1, 0.1, 0.3])))
    pose = PoseSample(2, Pose2(4.3, 3.1, -3.1), np.diag([1e-3, 1e-3, 1e-2]), 'camera/pose')
    estimate = estimator.predict(estimate, Motion(0.0, 0.0, 0.1), 2)
    after, found = estimator.update(estimate, pose)
    assert found.accepted
    assert after.mean[:2] == pytest.approx([4.3, 3.1], abs=0.02)
    assert abs(wrap(after.mean[2] + 3.1)) < 0.03
    sharper, found = estimator.update(after, HeadingSample(2, -3.0, 1e-4, 'compass'))
    assert found.accepted
    assert abs(wrap(sharper.mean[2] + 3.0)) < 0.03
    # The compass' deviation is 0.01; of 300 particles 0.1 wide that leaves two dozen, and the
    # share of wild measurements a little of the rest.
    assert 0.005 < math.sqrt(sharper.covariance[2, 2]) < 0.03


def test_blocked_ranges_hardly_pull(room):
    """One anchor reads two metres long for as long as it lasts: refused, the others carry on."""
    for name in ('pf', 'pf_uiekf'):
        drive = room.drive(6, seconds=5.0)
        localizer = Localizer(
            CONFIG.replace(estimator=name, initial_pose=(4.0, 3.0, 0.8)), room.anchors
        )
        for sample in in_time(drive):
            late = sample.stamp > 2_500_000_000
            if isinstance(sample, RangeSample) and sample.anchor_id == 'A1' and late:
                sample = replace(sample, range_m=sample.range_m + 2.0)
            feed(localizer, [sample])
        estimate = localizer.estimate
        assert estimate.pose.distance_to(drive.truth[estimate.stamp]) < 0.15


def test_standing_still_does_not_make_it_overconfident(room):
    """Six seconds of ranges with biases of its anchors, learned only as far as they show."""
    off = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        biases = rng.normal(0.0, 0.08, 4) + rng.normal(0.0, 0.1)
        drive = room.drive(seed, seconds=6.0, still=99.0, biases=list(biases))
        config = CONFIG.replace(estimator='pf_uiekf', initial_pose=(4.0, 3.0, 0.8))
        localizer = Localizer(config, room.anchors)
        feed(localizer, in_time(drive))
        estimate = localizer.estimate
        error = estimate.mean[:2] - (4.0, 3.0)
        off.append(error @ np.linalg.solve(estimate.pose_covariance[:2, :2], error))
    # Of chi-square with 2 x 5 degrees of freedom 99.9 % lie below 29.6.
    assert sum(off) < 29.6


def test_no_particle_that_fits_is_said_and_survived(room, monkeypatch):
    """Weights that are no numbers: the measurement is refused, the particles stay."""
    estimator = ESTIMATORS['pf'](CONFIG.filter, room.anchors, room.lever)
    estimate = estimator.start(Start(1, np.array([4.0, 3.0, 0.8]), np.eye(3) * 0.01))
    sample = RangeSample(1, 'A0', 'tag', 0, 5.0, 0.01)
    module = 'tablerunner.estimation.particles.draw._log_likelihood'
    for bad in (np.nan, -np.inf):
        monkeypatch.setattr(module, lambda white, _, bad=bad: np.full(len(white), bad))
        after, found = estimator.update(estimate, sample)
        assert not found.accepted
        assert found.reason == NO_PARTICLE
        assert after.mean == pytest.approx(estimate.mean, abs=1e-12)
        assert after.carried is estimate.carried


@ALL
def test_one_particle_runs(room, name):
    config = CONFIG.replace(
        estimator=name, filter=particles(least=1, at_start=1), initial_pose=(4.0, 3.0, 0.8)
    )
    localizer = Localizer(config, room.anchors)
    feed(localizer, in_time(room.drive(0, seconds=1.0)))
    assert np.all(np.isfinite(localizer.estimate.covariance))


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'at_start': 0}, 'at_start'),
        ({'least': 0}, 'least'),
        ({'least': 500, 'at_start': 400}, 'at most at_start'),
        ({'room': (1.0, 2.0)}, 'room.*4 numbers'),
        ({'room': (1.0, 2.0, 0.0, 3.0)}, 'from smaller than to'),
        ({'resampler': 'best'}, 'resampler'),
    ],
)
def test_bad_settings_are_named(changes, words):
    with pytest.raises(ConfigError, match=words):
        ParticleConfig(**changes)


def test_room_is_what_is_set_or_what_lies_between_the_anchors(room):
    start = Start(1, np.zeros(3), np.eye(3), anywhere=True)
    for settings, low, high in (
        ({}, (-1.0, -1.0), (13.0, 10.0)),
        ({'room': (2.0, 3.0, 4.0, 8.0)}, (2.0, 3.0), (4.0, 8.0)),
    ):
        estimator = ESTIMATORS['pf'](particles(**settings), room.anchors, room.lever)
        poses = estimator.start(start).carried.poses
        assert len(poses) == 4000
        assert np.all(poses[:, :2] >= low)
        assert np.all(poses[:, :2] <= high)
        # Uniform: of 4000 draws the outermost lie within a hundredth of the wall.
        side = np.subtract(high, low)
        assert poses[:, :2].min(axis=0) == pytest.approx(low, abs=0.01 * side.max())
        assert poses.mean(axis=0)[:2] == pytest.approx(np.add(low, high) / 2.0, abs=0.3)
        assert np.abs(poses[:, 2]).max() == pytest.approx(math.pi, abs=0.02)


@ALL
def test_odometry_errors_are_learned_from_the_poses_as_by_the_ekf(room, name):
    """Two metres told, two and four centimetres more driven, and turned: scale and turn scale."""
    start = Start(1, np.array([4.0, 3.0, 0.0]), np.eye(3) * 1e-6)
    config = particles(least=2000)
    found = []
    for which in (name, 'ekf'):
        estimator = ESTIMATORS[which](config, room.anchors, room.lever)
        estimate, at = estimator.start(start), Pose2(4.0, 3.0, 0.0)
        for k in range(20):
            told = Motion(0.1, 0.1, 0.2)
            at = advance(at, Motion(0.102, 0.1005, 0.2))
            estimate = estimator.predict(estimate, told, k + 2)
            if k % 5 == 4:
                pose = PoseSample(k + 2, at, np.diag([1e-4, 1e-4, 1e-4]), 'camera/pose')
                estimate, _ = estimator.update(estimate, pose)
        found.append(estimate)
    ours, expected = found
    assert expected.mean[3] > 0.01  # of 0.02: there is something to learn
    deviations = np.sqrt(np.diagonal(expected.covariance))[3:6]
    # 2000 particles: a fiftieth of a deviation, some times over for the resampling.
    assert np.abs(ours.mean[3:6] - expected.mean[3:6]).max() < 0.25 * deviations.max()
    assert abs(ours.mean[3] - expected.mean[3]) < 0.3 * deviations[0]
    assert np.sqrt(np.diagonal(ours.covariance))[3:6] == pytest.approx(deviations, rel=0.2)


def test_each_stamp_has_random_numbers_of_its_own(room):
    """The same range at another time draws other particles; at the same time the same."""
    estimator = ESTIMATORS['pf'](CONFIG.filter, room.anchors, room.lever)
    estimate = estimator.start(Start(1, np.array([4.0, 3.0, 0.8]), np.eye(3) * 0.01))
    means = []
    for stamp in (2, 2, 3):
        sample = RangeSample(stamp, 'A0', 'tag', 0, 5.0, 0.01)
        means.append(estimator.update(estimate, sample)[0].mean)
    assert np.array_equal(means[0], means[1])
    assert not np.array_equal(means[0], means[2])
