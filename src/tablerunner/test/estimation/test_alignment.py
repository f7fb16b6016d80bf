"""The start is found from ranges and driving, and believed only when it may be."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.estimation import Localizer, LocalizerConfig, LocalizerState
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, RangeSample

CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1))


def run(room, drive, config=CONFIG, anchors=None):
    """Feed a drive until the localiser is certain; return it and what it gave out before."""
    localizer = Localizer(config, anchors or room.anchors)
    provisional = []
    samples = sorted(
        [*drive.odometry, *drive.ranges],
        key=lambda s: (s.stamp, not isinstance(s, OdometrySample)),
    )
    for sample in samples:
        if isinstance(sample, OdometrySample):
            localizer.add_odometry(sample)
        else:
            outcome = localizer.add_range(sample)
            if outcome.estimate is not None and localizer.estimate is None:
                provisional.append(outcome.estimate)
        if localizer.estimate is not None:
            break
    return localizer, provisional, localizer.estimate


def test_start_is_found_at_the_right_pose_with_honest_covariance(room):
    """Over many seeds and headings: never a wrong heading, errors as large as told."""
    prior = CONFIG.filter
    nees, first = [], []
    for seed in range(40):
        heading = -math.pi + 2 * math.pi * seed / 40
        rng = np.random.default_rng([seed, 1])
        biases = rng.normal(0, prior.range_bias_common_std)
        biases = biases + rng.normal(0, prior.range_bias_std, 4)
        pose = Pose2(6.0, 4.5, heading)
        drive = room.drive(seed, seconds=15.0, start=pose, biases=biases)
        _, _, begun = run(room, drive)
        assert begun is not None
        truth = drive.truth[begun.stamp]
        turned = difference(begun.mean[2], truth.heading)
        error = np.array([begun.mean[0] - truth.x, begun.mean[1] - truth.y, turned])
        assert abs(turned) < 0.5
        nees.append(error @ np.linalg.solve(begun.pose_covariance, error))
        first.append((begun.stamp - 1_000_000_000) * 1e-9)
    # 40 runs of three errors. The finder adds odometry's noise, of which this drive has none.
    assert chi2.ppf(0.001, 120) < sum(nees) < chi2.ppf(0.999, 120)
    assert np.median(first) < 5.0


def test_start_while_standing_gives_position_but_no_heading(room):
    """Standing still, the position is told, the heading has the variance of ignorance."""
    drive = room.drive(3, seconds=8.0, still=100.0)
    localizer, provisional, begun = run(room, drive)
    assert begun is None
    assert localizer.map_to_odom is None
    assert localizer.status.state is LocalizerState.ALIGNING
    assert localizer.status.words == 'heading unknown: drive'
    last, truth = provisional[-1], drive.truth[drive.odometry[-1].stamp]
    assert math.hypot(last.mean[0] - truth.x, last.mean[1] - truth.y) < 0.3
    assert all(item.covariance[2, 2] > 1.0 for item in provisional)


def test_start_seen_by_two_anchors_on_a_straight_is_never_believed(room):
    """Two anchors see a straight drive and its mirror image alike: nothing may be believed."""
    for seed in range(5):
        drive = room.drive(seed, seconds=6.0, start=Pose2(4.0, 3.0, 0.0), turning=False)
        drive.ranges[:] = [sample for sample in drive.ranges if sample.anchor_id in {'A0', 'A1'}]
        localizer, provisional, begun = run(room, drive)
        assert begun is None
        assert provisional
        assert localizer.status.words == 'pose ambiguous: drive a curve'


def test_start_seen_by_two_anchors_in_a_curve_is_on_the_right_side(room):
    """A curve tells the mirror image from the truth."""
    for seed in range(5):
        drive = room.drive(seed, seconds=20.0, start=Pose2(4.0, 3.0, 0.0))
        drive.ranges[:] = [sample for sample in drive.ranges if sample.anchor_id in {'A0', 'A1'}]
        _, _, begun = run(room, drive)
        assert begun is not None
        truth = drive.truth[begun.stamp]
        assert math.hypot(begun.mean[0] - truth.x, begun.mean[1] - truth.y) < 0.6


def test_start_with_many_nlos_ranges_is_not_dragged(room):
    """A fifth of the ranges far too long still gives the right start."""
    errors = []
    for seed in range(10):
        drive = room.drive(seed, seconds=15.0)
        rng = np.random.default_rng(seed)
        for k in range(len(drive.ranges)):
            if rng.random() < 0.2:
                s = drive.ranges[k]
                drive.ranges[k] = RangeSample(
                    s.stamp,
                    s.anchor_id,
                    'tag',
                    0,
                    s.range_m + rng.uniform(0.5, 2.0),
                    s.variance_m2,
                )
        _, _, begun = run(room, drive)
        assert begun is not None
        truth = drive.truth[begun.stamp]
        errors.append(math.hypot(begun.mean[0] - truth.x, begun.mean[1] - truth.y))
        assert abs(difference(begun.mean[2], truth.heading)) < 0.4
    assert np.mean(errors) < 0.12


def test_start_from_config_needs_no_driving(room):
    """A configured pose is used with the first odometry."""
    config = CONFIG.replace(initial_pose=(4.0, 3.0, 0.8))
    localizer = Localizer(config, room.anchors)
    drive = room.drive(1, seconds=0.1)
    outcome = localizer.add_odometry(drive.odometry[0])
    assert outcome.estimate.mean[:3] == pytest.approx([4.0, 3.0, 0.8])
    assert localizer.status.state is LocalizerState.TRACKING


def test_start_is_not_believed_before_a_metre_is_driven(room):
    """A short way with biased ranges can point anywhere; how far is a parameter."""
    for least in (0.5, 1.0, 2.0):
        config = CONFIG.replace(alignment=CONFIG.alignment.replace(min_driven=least))
        for seed in range(5):
            drive = room.drive(seed, seconds=12.0)
            _, _, begun = run(room, drive, config)
            driven = 0.5 * (begun.stamp - drive.odometry[0].stamp) * 1e-9
            assert driven >= least - 0.02


def test_start_is_not_believed_of_wheels_that_spin_on_the_spot(room):
    """Odometry drives 10 m, ranges say that the robot stands: no pose is given out."""
    for seed in range(5):
        spinning = room.drive(seed, seconds=20.0)
        standing = room.drive(seed, seconds=20.0, still=20.0)
        drive = type(spinning)(spinning.odometry, standing.ranges, spinning.truth)
        localizer, _, begun = run(room, drive)
        assert begun is None
        assert localizer.status.state is LocalizerState.ALIGNING
