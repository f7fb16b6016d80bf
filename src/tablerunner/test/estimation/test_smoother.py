"""The smoother: exact where the model is linear, honest and better than the filter where not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tablerunner.estimation import ESTIMATORS, EstimatorConfig, LocalizerConfig, Start
from tablerunner.estimation.ekf import Ekf, bias_covariance
from tablerunner.estimation.models.motion_model import move
from tablerunner.estimation.models.state import GYRO_BIAS, SCALE, TURN_SCALE
from tablerunner.estimation.recording import RecordingLocalizer, Run, Step
from tablerunner.estimation.smoother import (
    extend_back,
    inverse_of_covariance,
    slope_of,
    smooth,
    smooth_step,
)
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import Estimate, Innovation, RangeSample

RUNS = 60
STEPS = 120
# The drives are drawn without delays, and nothing of them is blocked or slips.
CONFIG = EstimatorConfig(
    range_delay_std=0.0, range_delay_walk=0.0, huber=100.0, gate=1e6, persistence=4.0, doubt=4.0
)
PRIOR = np.array([0.2, 0.2, 0.1])

# -- a linear model with Gaussian noise ---------------------------------------------------------

# The third state is taken for an angle: it stays far below pi here.
TRANSITION = np.array(
    [
        [1.0, 0.1, 0.0, 0.3, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.2],
        [0.0, 0.01, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
NOISE = np.diag([0.01, 0.02, 1e-4, 0.0, 0.0])  # the fourth is constant, the fifth known
ROWS = {'a': [1.0, 0.0, 0.0, 0.0, 0.0], 'b': [0.5, -1.0, 0.2, 0.0, 0.0]}
ROWS |= {'c': [0.0, 0.0, 1.0, 1.0, 0.3]}
VARIANCE = 0.04


class Linear:
    """A Kalman filter on the model above."""

    def predict(self, estimate, motion, stamp):
        """Return the estimate at the next step."""
        covariance = TRANSITION @ estimate.covariance @ TRANSITION.T + NOISE
        return Estimate(stamp, TRANSITION @ estimate.mean, covariance)

    def update(self, estimate, sample):
        """Return the estimate corrected by a measurement."""
        row = np.array(ROWS[sample.anchor_id])
        gain = estimate.covariance @ row / (row @ estimate.covariance @ row + VARIANCE)
        keep = np.eye(5) - np.outer(gain, row)
        covariance = keep @ estimate.covariance @ keep.T + np.outer(gain, gain) * VARIANCE
        mean = estimate.mean + gain * (sample.range_m - row @ estimate.mean)
        return Estimate(sample.stamp, mean, covariance), Innovation(0, '', '', True, '')


def linear_run(rng, steps=12):
    """Return a run of the linear filter, two measurements at each third time, none at others."""
    mean, prior = rng.normal(size=5) * 0.1, np.diag([0.5, 0.3, 0.01, 0.2, 0.0])
    estimate = first = Estimate(0, mean, prior)
    filtered = []
    for k in range(1, steps + 1):
        motion, names = Motion(0.0, 0.0, 1.0), ['abc'[k % 3], 'c'] if k % 3 == 0 else [None]
        for name in names:
            sample = None
            if motion is not None:
                estimate = Linear().predict(estimate, motion, k)
            if name is not None:
                sample = RangeSample(k, name, '', 0, rng.normal() * 0.3)
                estimate, _ = Linear().update(estimate, sample)
            filtered.append(Step(k, motion, sample, estimate))
            motion = None
    start = Start(0, mean[:3], prior[:3, :3])
    return Run(Linear(), start, first, tuple(filtered), ())


def posterior(run):
    """Return mean and covariance of all states given all measurements, by conditioning at once.

    All states are linear in the prior state and the noise of each step; their joint distribution
    is conditioned on all measurements in one go, with no recursion in it.
    """
    count = 1 + max(step.stamp for step in run.steps)
    maps = np.zeros((count, 5, 5 * count))  # states as functions of (prior, noise 1, noise 2 ...)
    maps[0, :, :5] = np.eye(5)
    for k in range(1, count):
        maps[k] = TRANSITION @ maps[k - 1]
        maps[k, :, 5 * k : 5 * k + 5] += np.eye(5)
    spread = np.kron(np.eye(count), NOISE)
    spread[:5, :5] = run.first.covariance
    centre = np.zeros(5 * count)
    centre[:5] = run.first.mean
    seen = [step for step in run.steps if step.measurement is not None]
    rows = np.array([ROWS[s.measurement.anchor_id] @ maps[s.stamp] for s in seen])
    values = np.array([step.measurement.range_m for step in seen])
    joint = rows @ spread @ rows.T + VARIANCE * np.eye(len(seen))
    gain = np.linalg.solve(joint, rows @ spread).T
    centre = centre + gain @ (values - rows @ centre)
    spread = spread - gain @ joint @ gain.T
    return maps @ centre, maps @ spread @ maps.transpose(0, 2, 1)


@pytest.mark.parametrize('seed', range(5))
def test_smooth_linear_model_is_the_exact_posterior(seed):
    """States without noise, with no variance at all, and several measurements at one time."""
    run = linear_run(np.random.default_rng(seed))
    means, covariances = posterior(run)
    smoothed = smooth(run)
    assert len(smoothed) == 1 + len(run.steps)
    for estimate in smoothed:
        np.testing.assert_allclose(estimate.mean, means[estimate.stamp], atol=1e-8)
        np.testing.assert_allclose(estimate.covariance, covariances[estimate.stamp], atol=1e-8)
    # The smoother had something to do.
    assert np.abs(smoothed[0].mean - run.first.mean).max() > 0.05


@pytest.mark.parametrize('spread', [1.0, 1e3, 1e6])
def test_smooth_step_other_units_say_the_same(spread):
    """Deviations from `1 / spread` to `spread`: a change of units is none of the result."""
    rng = np.random.default_rng(3)
    units = np.array([spread, 1.0, 1.0, 1.0 / spread, 1.0])
    root = rng.normal(size=(5, 5)) * [1.0, 1.0, 0.1, 1.0, 1e-4]  # close to singular besides
    filtered = root @ root.T
    predicted = TRANSITION @ filtered @ TRANSITION.T + NOISE
    cross = filtered @ TRANSITION.T
    means = rng.normal(size=(3, 5)) * 0.1

    def step(scale):
        square = scale[:, None] * scale
        return smooth_step(
            Estimate(0, means[0] * scale, filtered * square),
            Estimate(1, means[1] * scale, predicted * square),
            cross * square,
            Estimate(1, means[2] * scale, 0.5 * predicted * square),
        )

    plain, scaled = step(np.ones(5)), step(units)
    deviation = np.sqrt(np.diagonal(plain.covariance))
    # The inverse of a matrix of condition 1e8 keeps half of the 16 digits.
    np.testing.assert_allclose(scaled.mean / units, plain.mean, atol=1e-6)
    np.testing.assert_allclose(
        scaled.covariance / (units[:, None] * units) / (deviation[:, None] * deviation),
        plain.covariance / (deviation[:, None] * deviation),
        atol=1e-6,
    )
    assert np.linalg.eigvalsh(plain.covariance)[0] >= -1e-15


def test_smooth_step_certain_prediction_holds_the_filter():
    """Nothing can be learned later of what was certain before, whatever is said later."""
    sure = np.diag([1.0, 1.0, 0.1, 0.0, 0.0])
    filtered = Estimate(0, np.zeros(5), sure)
    later = Estimate(1, np.array([0.5, 0.0, 0.0, 1.0, 1.0]), 0.5 * sure)
    result = smooth_step(filtered, Estimate(1, np.zeros(5), sure), sure, later)
    np.testing.assert_allclose(result.mean, [0.5, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(result.covariance, 0.5 * sure, atol=1e-12)


def test_inverse_of_covariance_undoes_it_where_it_can():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(4, 4)) * [[1e-6], [1.0], [1e3], [1.0]]
    covariance = np.zeros((5, 5))
    covariance[:4, :4] = root @ root.T
    inverse = inverse_of_covariance(covariance)
    np.testing.assert_allclose((inverse @ covariance)[:4, :4], np.eye(4), atol=1e-6)
    assert not inverse[4].any()
    # What rounding makes of a variance of zero, with what it makes of the covariances beside it.
    covariance[4, 4], covariance[3, 4] = 1e-36, 1e-17
    covariance[4, 3] = covariance[3, 4]
    np.testing.assert_allclose(inverse_of_covariance(covariance), inverse, rtol=1e-9)
    # Nearly the same twice: what little they differ by is still something.
    twins = np.array([[1.0, 1.0 - 1e-7], [1.0 - 1e-7, 1.0]])
    np.testing.assert_allclose(inverse_of_covariance(twins) @ twins, np.eye(2), atol=1e-6)


# -- the robot ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def runs(room):
    """Return runs of the ekf on drives drawn from the model that it assumes, and their truth."""
    return [drawn_run(room, 'ekf', seed) for seed in range(RUNS)]


def drawn_run(room, name, seed):
    """Return a run and the true poses, shape (1 + steps, 3), of a drive drawn from the model."""
    rng = np.random.default_rng(seed)
    scale = rng.normal(0, CONFIG.scale_std)
    drift, turning = rng.normal(0, CONFIG.gyro_bias_std), rng.normal(0, CONFIG.turn_scale_std)
    biases = rng.multivariate_normal(np.zeros(4), bias_covariance(CONFIG, 4))
    stretch = rng.normal(0, CONFIG.range_scale_std, 4)
    mean = np.array([6.0, 4.5, 2.9])
    true = Pose2(*(mean + rng.normal(0, PRIOR)))
    estimator = ESTIMATORS[name](CONFIG, room.anchors, room.lever)
    start = Start(1, mean, np.diag(PRIOR**2))
    estimate = first = estimator.start(start)
    steps, poses = [], [true]
    for k in range(1, STEPS + 1):
        told = Motion(0.1, 0.12 * math.sin(0.05 * k), 0.2)
        distance, turn = CONFIG.motion.variances(told)
        real = Motion(
            (1 + scale) * (told.distance_m + rng.normal(0, math.sqrt(distance))),
            (1 + turning) * told.turn_rad - drift * told.dt_s + rng.normal(0, math.sqrt(turn)),
            told.dt_s,
        )
        true = advance(true, real)
        scale += rng.normal(0, CONFIG.scale_walk * math.sqrt(told.distance_m))
        drift += rng.normal(0, CONFIG.gyro_bias_walk * math.sqrt(told.dt_s))
        turning += rng.normal(0, CONFIG.turn_scale_walk * math.sqrt(abs(told.turn_rad)))
        biases += rng.normal(0, CONFIG.range_bias_walk * math.sqrt(told.dt_s), 4)
        estimate = estimator.predict(estimate, told, k + 1)
        anchor = room.anchors[k % 4]
        tag = true.transform(np.array(room.lever[:2]))
        measured = math.dist((*tag, room.lever[2]), anchor.position)
        measured += stretch[k % 4] * measured + biases[k % 4] + rng.normal(0, 0.1)
        sample = RangeSample(k + 1, anchor.anchor_id, 'tag', k, measured, 0.01)
        estimate, _ = estimator.update(estimate, sample)
        steps.append(Step(k + 1, told, sample, estimate))
        poses.append(true)
    truth = np.array([(pose.x, pose.y, pose.heading) for pose in poses])
    return Run(estimator, start, first, tuple(steps), ()), truth


def errors(estimates, truth):
    """Return the errors of the poses, shape (n, 3)."""
    difference = np.array([item.mean[:3] for item in estimates]) - truth
    difference[:, 2] = wrap(difference[:, 2])
    return difference


def test_smooth_is_better_than_the_filter_and_as_sure_as_it_may_be(runs):
    """NEES averaged over runs inside two-sided bounds; errors smaller, and never worse at the end.

    What is learned later of the pose at the same time halves the squared error over a drive.
    """
    nees, before, after, worse = [], [], [], 0
    for run, truth in runs:
        smoothed = smooth(run)
        filtered = [run.first, *(step.after for step in run.steps)]
        off, was = errors(smoothed, truth), errors(filtered, truth)
        nees.append(
            [
                error @ np.linalg.solve(item.pose_covariance, error)
                for error, item in zip(off, smoothed, strict=True)
            ]
        )
        before.append(np.sum(was[:, :2] ** 2, axis=1).mean())
        after.append(np.sum(off[:, :2] ** 2, axis=1).mean())
        worse += after[-1] > before[-1]
        np.testing.assert_array_equal(off[-1], was[-1])
        for early, item in zip(smoothed[::20], filtered[::20], strict=True):
            gained = np.linalg.eigvalsh(item.covariance - early.covariance)
            assert gained[0] > -1e-6 * item.covariance.max()
    mean = np.mean(nees, axis=0)
    low, high = chi2.ppf([0.025, 0.975], 3 * RUNS) / RUNS
    assert np.mean((mean > low) & (mean < high)) >= 0.9
    assert np.mean(after) < 0.6 * np.mean(before)
    assert worse <= RUNS // 20


def test_smooth_ukf_agrees_with_ekf(room):
    """Where the pose is well known both linearisations say the same, to a tenth of what is open.

    Heading crosses pi on the way, which is no jump.
    """
    ekf, truth = drawn_run(room, 'ekf', 5)
    ukf, _ = drawn_run(room, 'ukf', 5)
    assert np.ptp(wrap(truth[:, 2])) > 6.0
    for one, other in zip(smooth(ekf), smooth(ukf), strict=True):
        difference = one.mean - other.mean
        difference[2] = wrap(float(difference[2]))
        assert np.all(np.abs(difference) <= 0.1 * np.sqrt(np.diagonal(one.covariance)) + 1e-9)


def test_smooth_turned_room_gives_the_turned_path(room):
    """No direction is special, not even that where headings jump."""
    turn = Pose2(0.0, 0.0, math.pi - 0.9)
    drive = room.drive(1, 6.0, noise=0.05)

    def path(turned):
        anchors = tuple(
            replace(
                anchor,
                position=(*turned.transform(np.array(anchor.position[:2])), anchor.position[2]),
            )
            for anchor in room.anchors
        )
        start = turned @ Pose2(4.1, 3.1, 0.7)
        config = LocalizerConfig(
            tag_position=room.lever, initial_pose=(start.x, start.y, start.heading)
        )
        smoothed = smooth(feed(RecordingLocalizer(config, anchors), drive).runs()[0])
        return [turned.inverse() @ item.pose for item in smoothed]

    for one, other in zip(path(Pose2()), path(turn), strict=True):
        assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=1e-8)
        assert wrap(one.heading - other.heading) == pytest.approx(0.0, abs=1e-8)


def test_slope_is_the_jacobian_of_the_motion(room):
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    estimate = ekf.start(Start(0, np.array([1.0, 2.0, 3.1]), np.diag(PRIOR**2)))
    estimate.mean[[SCALE, TURN_SCALE, GYRO_BIAS]] = 0.03, 0.01, 0.02
    motion = Motion(0.4, 0.3, 0.5)
    expected = move(estimate.mean, motion).by_state
    np.testing.assert_allclose(slope_of(ekf, estimate, motion, 1), expected, atol=1e-9)


def feed(localizer, drive):
    """Give a drive to a localiser in the order of stamps."""
    for sample in sorted([*drive.odometry, *drive.ranges], key=lambda item: item.stamp):
        if isinstance(sample, RangeSample):
            localizer.add_range(sample)
        else:
            localizer.add_odometry(sample)
    return localizer


@pytest.mark.parametrize(('name', 'seeds'), [('ekf', 10), ('ukf', 2)])
def test_extend_back_reaches_the_first_odometry_and_is_honest(room, name, seeds):
    """The start is found seconds later; from there back the errors are what is said of them."""
    config = LocalizerConfig(name, tag_position=room.lever)
    nees = []
    for seed in range(seeds):
        drive = room.drive(seed, 8.0, biases=[0.1, 0.0, 0.05, -0.05], scale=0.01, drift=0.005)
        run = feed(RecordingLocalizer(config, room.anchors), drive).runs()[0]
        assert run.start.stamp > drive.odometry[0].stamp + 1_000_000_000
        start = smooth(run)[0]
        early = extend_back(run, start)
        assert early[0].stamp == drive.odometry[0].stamp
        assert [item.stamp for item in early] == sorted({item.stamp for item in early})
        error = errors(early[:1], np.array([drive_pose(drive.truth[early[0].stamp])]))[0]
        nees.append(error @ np.linalg.solve(early[0].pose_covariance, error))
        assert np.hypot(*error[:2]) < 0.3
    # Odometry itself is exact here but for scale and drift: below the upper bound is what counts.
    assert np.mean(nees) < chi2.ppf(0.99, 3 * seeds) / seeds


def drive_pose(pose):
    """Return a pose as a row."""
    return pose.x, pose.y, pose.heading


def test_extend_back_undoes_the_motion(room):
    """Carried on again from where it led back to, the estimate is where it was."""
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    config = LocalizerConfig(tag_position=room.lever)
    run = feed(RecordingLocalizer(config, room.anchors), room.drive(2, 12.0)).runs()[0]
    start = smooth(run)[0]
    early = extend_back(run, start)
    again = early[0]
    noise = again._replace(covariance=np.zeros_like(again.covariance))
    for lead in run.lead_in:
        stamp = again.stamp + round(lead.onward.dt_s * 1e9)
        if lead.onward.dt_s > 0.0:
            again = ekf.predict(again, lead.onward, stamp)
            noise = ekf.predict(noise, lead.onward, stamp)
    assert again.stamp == start.stamp
    np.testing.assert_allclose(again.mean, start.mean, atol=1e-9)
    # There and back again: both ways add the noise of odometry.
    np.testing.assert_allclose(
        again.covariance, start.covariance + 2.0 * noise.covariance, atol=1e-9
    )
    assert noise.covariance[2, 2] > 1e-5
