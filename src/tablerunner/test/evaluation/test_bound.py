"""The bound against closed forms, against the filter at the truth, and against drawn runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf, bias_covariance
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    HEADING,
    RANGE_BIAS,
    SCALE,
    TURN_SCALE,
    X,
    Y,
)
from tablerunner.evaluation.bound import BoundModel, posterior_bound
from tablerunner.evaluation.truth import Truth
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, MotionNoise, advance
from tablerunner.types import Anchor, RangeSample

STEP = 100_000_000
NO_NOISE = MotionNoise(
    distance=0.0, heading_per_turn=0.0, heading_per_distance=0.0, heading_per_time=0.0
)
SQUARE = ((0.0, 0.0, 2.25), (12.0, 0.0, 2.25), (12.0, 9.0, 2.25), (0.0, 9.0, 2.25))


def model_of(anchors, prior, **changes):
    """Return a model in which only the given states have a prior."""
    size = RANGE_BIAS + 2 * len(anchors)
    covariance = np.zeros((size, size))
    for index, variance in prior.items():
        covariance[index, index] = variance
    model = BoundModel(anchors, (0.0, 0.0, 0.0), covariance, NO_NOISE, np.zeros(size), 0.1)
    return replace(model, **changes)


def truth_of(poses):
    stamps = [1_000_000_000 + k * STEP for k in range(len(poses))]
    return Truth.from_poses((stamp, pose, True) for stamp, pose in zip(stamps, poses, strict=True))


def test_standing_robot_is_known_by_all_information_together():
    """Far anchors make ranges linear: P^-1 = P0^-1 + n u u' / r^2, worked out by NumPy."""
    anchors = ((3000.0, 4000.0, 0.0), (-4000.0, 0.0, 0.0))
    truth = truth_of([Pose2()] * 6)
    which = [0, 0, 0, 1, 1]
    bounds = posterior_bound(model_of(anchors, {X: 0.04, Y: 0.09}), truth, truth.stamps[:5], which)
    along = np.array([[0.6, 0.8], [-1.0, 0.0]])
    information = np.diag([1 / 0.04, 1 / 0.09])
    for row, anchor in enumerate(which):
        np.testing.assert_allclose(bounds[row, :2, :2], np.linalg.inv(information), rtol=1e-6)
        information = information + np.outer(along[anchor], along[anchor]) / 0.01
    np.testing.assert_allclose(bounds[5, :2, :2], np.linalg.inv(information), rtol=1e-6)


def test_straight_drive_settles_at_the_riccati_solution():
    """One dimension: before each range p, and p r / (p + r) = p - q, which has a closed form."""
    noise = replace(NO_NOISE, distance=0.05)
    model = model_of(((1e6, 0.0, 0.0),), {X: 1.0}, motion=noise)
    truth = truth_of([Pose2(0.05 * k) for k in range(200)])
    bounds = posterior_bound(model, truth, truth.stamps, [0] * 200)
    q, r = 0.05**2 * 0.05, 0.1**2
    settled = 0.5 * (q + math.sqrt(q * q + 4.0 * q * r))
    assert bounds[-1, X, X] == pytest.approx(settled, rel=1e-6)


def test_constant_bias_leaves_its_prior_between_place_and_range():
    """A range of one anchor says p + b: the place along it keeps p b / (p + b), however many."""
    model = model_of(((1e6, 0.0, 0.0),), {X: 0.04, RANGE_BIAS: 0.01})
    truth = truth_of([Pose2()] * 20_000)
    bounds = posterior_bound(model, truth, truth.stamps, [0] * len(truth))
    assert bounds[-1, X, X] == pytest.approx(0.04 * 0.01 / 0.05, rel=1e-3)


def test_dead_reckoning_carries_heading_and_scale_across_and_along():
    """Straight on by d: variance along P_s d^2, across P_h d^2, and nothing else."""
    model = model_of((), {HEADING: 0.01, SCALE: 0.0004})
    truth = truth_of([Pose2(0.1 * k) for k in range(101)])
    last = posterior_bound(model, truth, np.empty(0, dtype=np.int64), [])[-1]
    assert last[X, X] == pytest.approx(0.0004 * 10.0**2)
    assert last[Y, Y] == pytest.approx(0.01 * 10.0**2)
    assert last[Y, HEADING] == pytest.approx(0.01 * 10.0)


def test_turn_scale_and_gyro_bias_make_the_heading_uncertain():
    """A turn by a in t: P_k a^2 + P_b t^2."""
    model = model_of((), {TURN_SCALE: 1e-4, GYRO_BIAS: 1e-6})
    truth = truth_of([Pose2(0.0, 0.0, 0.05 * k) for k in range(41)])
    last = posterior_bound(model, truth, np.empty(0, dtype=np.int64), [])[-1]
    assert last[HEADING, HEADING] == pytest.approx(1e-4 * 2.0**2 + 1e-6 * 4.0**2)


def test_scale_of_a_range_is_its_error_in_proportion():
    """One anchor far off at D: known through a range of noise r and scale k: r^2 + (k D)^2."""
    anchors = ((1000.0, 0.0, 0.0),)
    scale = RANGE_BIAS + 1
    truth = truth_of([Pose2()] * 2)
    model = model_of(anchors, {X: 1e6, scale: 1e-6})
    bounds = posterior_bound(model, truth, truth.stamps[:1], [0])
    assert bounds[-1, X, X] == pytest.approx(0.1**2 + 1e-6 * 1000.0**2, rel=1e-4)


def test_ranges_outside_of_the_truth_are_left_out():
    truth = truth_of([Pose2()] * 3)
    model = model_of(SQUARE, {X: 0.04, Y: 0.04})
    outside = np.array([truth.stamps[0] - 1, truth.stamps[-1] + 1])
    bounds = posterior_bound(model, truth, outside, [0, 1])
    np.testing.assert_allclose(bounds[-1], np.diag([0.04, 0.04, 0.0]))


def test_states_that_walk_lose_certainty_with_time():
    """A gyroscope whose bias walks by w: the heading's variance grows to w^2 t^3 / 3."""
    walk = np.zeros(RANGE_BIAS)
    walk[GYRO_BIAS] = 1e-4**2
    model = model_of((), {}, walk_per_time=walk)
    truth = truth_of([Pose2(0.05 * k) for k in range(1001)])
    last = posterior_bound(model, truth, np.empty(0, dtype=np.int64), [])[-1]
    # In steps of 0.1 s the sum is less than the integral by 1.5 steps of 1000.
    assert last[HEADING, HEADING] == pytest.approx(1e-8 * 100.0**3 / 3.0, rel=0.003)


CONFIG = EstimatorConfig(huber=100.0, gate=1e6, persistence=4.0, doubt=4.0, range_delay_std=0.0)
PRIOR = np.array([0.2, 0.2, 0.1])
LEVER = (-0.1, 0.05, 1.1)
STEPS = 400
BOUND = BoundModel(
    SQUARE,
    LEVER,
    np.zeros((RANGE_BIAS + 8, RANGE_BIAS + 8)),
    CONFIG.motion,
    np.zeros(RANGE_BIAS + 8),
    0.1,
)


def bound_of_config():
    """Return the model of `CONFIG`, in which nothing walks."""
    prior = np.zeros((RANGE_BIAS + 8, RANGE_BIAS + 8))
    prior[:3, :3] = np.diag(PRIOR**2)
    for index, deviation in (
        (SCALE, CONFIG.scale_std),
        (TURN_SCALE, CONFIG.turn_scale_std),
        (GYRO_BIAS, CONFIG.gyro_bias_std),
    ):
        prior[index, index] = deviation**2
    prior[RANGE_BIAS : RANGE_BIAS + 4, RANGE_BIAS : RANGE_BIAS + 4] = bias_covariance(CONFIG, 4)
    prior[RANGE_BIAS + 4 :, RANGE_BIAS + 4 :] = np.eye(4) * CONFIG.range_scale_std**2
    return replace(BOUND, prior=prior)


STILL = replace(
    CONFIG,
    scale_walk=0.0,
    turn_scale_walk=0.0,
    gyro_bias_walk=0.0,
    range_delay_walk=0.0,
    range_bias_walk=0.0,
)


def drawn(seed, exact=False):
    """Return true poses, ranges, and what the ekf believed, all drawn from `STILL` itself.

    With `exact`, nothing is drawn: the filter runs along the truth.
    """
    rng = np.random.default_rng(seed)
    share = 0.0 if exact else 1.0
    scale = share * rng.normal(0, STILL.scale_std)
    turn_scale = share * rng.normal(0, STILL.turn_scale_std)
    range_scales = share * rng.normal(0, STILL.range_scale_std, 4)
    drift = share * rng.normal(0, STILL.gyro_bias_std)
    biases = share * rng.multivariate_normal(np.zeros(4), bias_covariance(STILL, 4))
    start = np.array([6.0, 4.5, 0.3])
    true = Pose2(*(start + share * rng.normal(0, PRIOR)))
    anchors = tuple(Anchor(f'A{i}', place) for i, place in enumerate(SQUARE))
    ekf = Ekf(STILL, anchors, LEVER)
    stamp = 1_000_000_000
    estimate = ekf.start(Start(stamp, start, np.diag(PRIOR**2)))
    poses, estimates, stamps = [true], [estimate], []
    for k in range(1, STEPS + 1):
        stamp += 40_000_000
        told = Motion(0.02, 0.012 * math.sin(0.01 * k), 0.04)
        distance, turn = STILL.motion.variances(told)
        real = Motion(
            (1 + scale) * (told.distance_m + share * rng.normal(0, math.sqrt(distance))),
            (1 + turn_scale) * told.turn_rad
            - drift * 0.04
            + share * rng.normal(0, math.sqrt(turn)),
            0.04,
        )
        true = advance(true, real)
        estimate = ekf.predict(estimate, told, stamp)
        poses.append(true)
        estimates.append(estimate)
        stamps.append(stamp)
        anchor = anchors[k % 4]
        tag = true.transform(np.array(LEVER[:2]))
        measured = math.dist((*tag, LEVER[2]), anchor.position)
        measured += range_scales[k % 4] * measured
        measured += biases[k % 4] + share * rng.normal(0, 0.1)
        sample = RangeSample(stamp, anchor.anchor_id, 'tag', k, measured, 0.01)
        estimate, _ = ekf.update(estimate, sample)
    truth = Truth.from_poses(
        (item.stamp, pose, True) for item, pose in zip(estimates, poses, strict=True)
    )
    return truth, np.array(stamps), estimates


def test_filter_that_runs_at_the_truth_believes_the_bound():
    """Same models, same noise: covariances equal but for the least differences of motions."""
    truth, stamps, estimates = drawn(0, exact=True)
    bounds = posterior_bound(
        bound_of_config(), truth, stamps, [k % 4 for k in range(1, STEPS + 1)]
    )
    believed = np.array([item.pose_covariance for item in estimates])
    np.testing.assert_allclose(bounds, believed, rtol=1e-5, atol=1e-12)


def test_no_estimator_beats_the_bound_and_a_matched_one_reaches_it():
    """Mean square errors of 60 drawn runs over their mean bound.

    They follow each other in time, about ten independent errors of two dimensions in a run: the
    ratio of the sums has a deviation of about sqrt(2 / 1200) = 4 %, of which three are allowed.
    """
    squares, bounds = np.zeros(2), np.zeros(2)
    for seed in range(60):
        truth, stamps, estimates = drawn(seed)
        means = np.array([item.mean[:3] for item in estimates])
        errors = means[:, :2] - truth.positions
        turns = np.array([wrap(float(turn)) for turn in means[:, 2] - truth.headings])
        squares += np.mean(np.sum(errors**2, axis=1)), np.mean(turns**2)
        least = posterior_bound(
            bound_of_config(), truth, stamps, [k % 4 for k in range(1, STEPS + 1)]
        )
        bounds += np.mean(least[:, 0, 0] + least[:, 1, 1]), np.mean(least[:, 2, 2])
    ratios = squares / bounds
    assert np.all(ratios > 0.85)
    assert np.all(ratios < 1.15)
