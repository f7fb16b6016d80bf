"""The iterated filters: equal to the `ekf` where they must be, else at the most likely state."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.iekf import Iekf, LmIekf
from tablerunner.estimation.models.range_model import predict_ranges
from tablerunner.estimation.particles.iterated import Iteration
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion
from tablerunner.types import HeadingSample, PoseSample, RangeSample

# Nothing is refused or reweighed: what is compared is the update alone.
CONFIG = EstimatorConfig(huber=99.0, gate=1e6, pose_gate=1e6, persistence=4.0, doubt=4.0)
BOTH = pytest.mark.parametrize('make', [Iekf, LmIekf])


def started(make, room, seed, spread=(0.8, 0.8, 0.5), config=CONFIG):
    """Return a filter and a wide estimate that has moved, so that its states hang together."""
    rng = np.random.default_rng(seed)
    estimator = make(config, room.anchors, room.lever)
    pose = np.array([rng.uniform(1, 11), rng.uniform(1, 8), rng.uniform(-3, 3)])
    estimate = estimator.start(Start(1, pose, np.diag(np.square(spread))))
    return estimator, estimator.predict(estimate, Motion(0.3, 0.2, 0.5), 2)


def ranges(room, estimate, seed, std=0.05):
    """Return what the anchors read for a true state drawn from the estimate."""
    rng = np.random.default_rng(seed)
    true = rng.multivariate_normal(estimate.mean, estimate.covariance)
    places = [(anchor.position, index) for index, anchor in enumerate(room.anchors)]
    expected, _ = predict_ranges(true, places, room.lever, estimate.twist)
    return [
        RangeSample(2, anchor.anchor_id, 'tag', k, value + rng.normal(0, std), std**2)
        for k, (anchor, value) in enumerate(zip(room.anchors, expected, strict=True))
    ]


def cost_of(room, before, mean, samples):
    """Return V at a mean."""
    places = [(room.anchors[int(s.anchor_id[1])].position, int(s.anchor_id[1])) for s in samples]
    expected, _ = predict_ranges(mean, places, room.lever, before.twist)
    off = np.array([s.range_m for s in samples]) - expected
    apart = mean - before.mean
    apart[2] = math.remainder(apart[2], 2.0 * math.pi)
    variances = [s.variance_m2 for s in samples]
    return apart @ np.linalg.solve(before.covariance, apart) + np.sum(off**2 / variances)


@BOTH
@pytest.mark.parametrize('count', [1, 4])
def test_one_step_equals_the_ekf(room, monkeypatch, make, count):
    monkeypatch.setattr(make, 'iteration', Iteration(1, make.iteration.damped))
    for seed in range(10):
        estimator, before = started(make, room, seed)
        samples = ranges(room, before, seed)[:count]
        after, found = estimator.update_ranges(before, samples)
        expected, same = Ekf(CONFIG, room.anchors, room.lever).update_ranges(before, samples)
        assert after.mean == pytest.approx(expected.mean, abs=1e-9)
        # A single range's noise is found from how far the covariance fell: ten digits are left.
        assert after.covariance == pytest.approx(expected.covariance, abs=1e-8)
        assert [item.nis for item in found] == pytest.approx([item.nis for item in same])


@BOTH
def test_linear_measurements_equal_the_ekf(room, make):
    """A position or pose of base_link itself, and a heading."""
    samples = (
        PoseSample(2, Pose2(5.0, 4.0, 0.4), np.diag([0.02, 0.03, 0.01]), 'camera'),
        PoseSample(2, Pose2(5.0, 4.0, 0.0), np.diag([0.02, 0.03, np.inf]), 'uwb/pose'),
        HeadingSample(2, 0.3, 0.01, 'compass'),
    )
    for sample in samples:
        estimator, before = started(make, room, 3)
        after, _ = estimator.update(before, sample)
        expected, _ = Ekf(CONFIG, room.anchors, room.lever).update(before, sample)
        assert after.mean == pytest.approx(expected.mean, abs=1e-6)
        assert after.covariance == pytest.approx(expected.covariance, abs=1e-8)


@BOTH
@pytest.mark.parametrize('count', [1, 4])
def test_maximum_a_posteriori_is_reached(room, make, count):
    """SciPy's least squares, begun at the result, finds nothing better."""
    for seed in range(8):
        estimator, before = started(make, room, seed, (0.4, 0.4, 0.3))
        samples = ranges(room, before, seed)[:count]
        after, _ = estimator.update_ranges(before, samples)
        root = np.linalg.cholesky(before.covariance)

        def residuals(y, before=before, root=root, samples=samples):
            mean = before.mean + root @ y
            places = [
                (room.anchors[int(s.anchor_id[1])].position, int(s.anchor_id[1])) for s in samples
            ]
            expected, _ = predict_ranges(mean, places, room.lever, before.twist)
            off = np.array([s.range_m for s in samples]) - expected
            return np.concatenate([y, off / np.sqrt([s.variance_m2 for s in samples])])

        apart = after.mean - before.mean
        apart[2] = math.remainder(apart[2], 2.0 * math.pi)
        best = least_squares(residuals, np.linalg.solve(root, apart), xtol=1e-14, gtol=1e-14)
        assert cost_of(room, before, after.mean, samples) == pytest.approx(
            2.0 * best.cost, rel=1e-6, abs=1e-6
        )


def test_damped_never_costs_more_than_before(room):
    """Wide priors under an anchor: one step overshoots now and then, the damped search never."""
    worse = {'ekf': 0, 'lm_iekf': 0}
    for seed in range(60):
        estimator = LmIekf(CONFIG, room.anchors, room.lever)
        under = np.array([0.4, 0.2, 0.3])
        before = estimator.start(Start(2, under, np.diag(np.square([2.0, 2.0, 1.5]))))
        samples = ranges(room, before, seed, 0.02)[:2]
        first = cost_of(room, before, before.mean.copy(), samples)
        for filter_ in (Ekf(CONFIG, room.anchors, room.lever), estimator):
            after, _ = filter_.update_ranges(before, samples)
            worse[filter_.name] += cost_of(room, before, after.mean, samples) > first + 1e-9
    assert worse['lm_iekf'] == 0
    assert worse['ekf'] > 0  # else the test shows nothing


@BOTH
def test_refused_and_reweighed_ranges_are_the_ekfs(room, make):
    """The judgement is the `ekf`'s own; a refused range changes nothing but the memory."""
    config = EstimatorConfig()
    estimator, before = started(make, room, 1, (0.05, 0.05, 0.02), config)
    plain = Ekf(config, room.anchors, room.lever)
    sample = replace(ranges(room, before, 1)[0], variance_m2=0.01)
    for off in (0.3, 0.6, 3.0):
        measured = replace(sample, range_m=sample.range_m + off)
        after, found = estimator.update(before, measured)
        expected, same = plain.update(before, measured)
        assert (found.accepted, found.reason, found.nis) == (
            same.accepted,
            same.reason,
            same.nis,
        )
        assert after.memory == expected.memory
        # Five centimetres seen from metres away are nearly straight.
        assert after.mean == pytest.approx(expected.mean, abs=2e-3)
    assert not found.accepted
    assert np.array_equal(after.mean, before.mean)


@BOTH
def test_marker_off_the_base_is_iterated(room, make):
    """A point a metre ahead turns with the heading: the cost falls below the ekf's."""
    covariance = np.diag([1e-4, 1e-4, np.inf])
    sample = PoseSample(2, Pose2(6.0, 4.5, 0.0), covariance, 'camera', (1.0, 0.0))
    estimator = make(CONFIG, room.anchors, room.lever)
    before = estimator.start(Start(1, np.array([5.0, 4.0, -0.6]), np.diag([0.01, 0.01, 1.0])))

    def cost(mean):
        apart = (mean - before.mean)[:3]
        heading = mean[2]
        off = np.array([6.0, 4.5]) - mean[:2] - (math.cos(heading), math.sin(heading))
        return np.sum(apart**2 / (0.01, 0.01, 1.0)) + np.sum(off**2) / 1e-4

    plain, _ = Ekf(CONFIG, room.anchors, room.lever).update(before, sample)
    after, _ = estimator.update(before, sample)
    assert cost(after.mean) < 0.1 * cost(plain.mean)
