"""Noise from innovations: found again where it is known, held where the data say nothing."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from tablerunner.errors import TuningError
from tablerunner.estimation import EstimatorConfig, LocalizerConfig, Start
from tablerunner.estimation.ekf import Ekf, bias_covariance
from tablerunner.estimation.likelihood import (
    Drive,
    DriveStep,
    drive_of,
    robust_loss,
    run_drives,
    scale_weight,
)
from tablerunner.estimation.recording import RecordingLocalizer
from tablerunner.estimation.tuning import RANGE_STD, TUNABLE, Verdict, set_parameters, tune
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, MotionNoise, advance
from tablerunner.types import OdometrySample, RangeSample

TRUE = EstimatorConfig(
    motion=MotionNoise(0.08, 0.08, 0.005, 0.001),
    range_bias_walk=1e-3,
    default_range_std=0.08,
    turn_scale_std=0.0,
    range_delay_std=0.0,
)
WRONG = 3.0


def drawn(room, seed, steps=240, told=0.0, blocked=0.0):
    """Return a drive whose noise is that of TRUE; ranges tell a deviation of `told`."""
    rng = np.random.default_rng(seed)
    scale, drift = rng.normal(0, TRUE.scale_std), rng.normal(0, TRUE.gyro_bias_std)
    biases = rng.multivariate_normal(np.zeros(4), bias_covariance(TRUE, 4))
    prior = np.array([0.2, 0.2, 0.1])
    mean = np.array([6.0, 4.5, 0.3])
    true = Pose2(*(mean + rng.normal(0, prior)))
    taken = []
    for k in range(1, steps + 1):
        motion = Motion(0.06, 0.12 * math.sin(0.05 * k), 0.1)
        distance, turn = TRUE.motion.variances(motion)
        real = Motion(
            (1 + scale) * (motion.distance_m + rng.normal(0, math.sqrt(distance))),
            motion.turn_rad - drift * motion.dt_s + rng.normal(0, math.sqrt(turn)),
            motion.dt_s,
        )
        true = advance(true, real)
        biases += rng.normal(0, TRUE.range_bias_walk * math.sqrt(motion.dt_s), 4)
        stamp = 1 + k * 100_000_000
        ranges = []
        for turn_of in (0, 1):
            anchor = room.anchors[(2 * k + turn_of) % 4]
            tag = true.transform(np.array(room.lever[:2]))
            measured = math.dist((*tag, room.lever[2]), anchor.position)
            measured += biases[(2 * k + turn_of) % 4] + rng.normal(0, TRUE.default_range_std)
            if rng.random() < blocked:
                measured += rng.uniform(0.5, 3.0)
            sample = RangeSample(stamp, anchor.anchor_id, 'tag', k, measured, told**2)
            ranges.append(sample)
        taken.append(DriveStep(stamp, motion, tuple(ranges)))
    return Drive(Start(1, mean, np.diag(prior**2)), tuple(taken))


def make(room, config):
    """Return an ekf for the room."""
    return Ekf(config, room.anchors, room.lever)


def wrong(factor):
    """Return settings with range noise and odometry's noise wrong by a factor."""
    return set_parameters(
        TRUE,
        {
            'default_range_std': 0.08 * factor,
            'motion.distance': 0.08 / factor,
            'motion.heading_per_turn': 0.08 * factor,
        },
    )


def judged(room, config, drive, factor=1.0):
    """Return mean NIS and log likelihood for each range of a drive."""
    seen = run_drives(make(room, config), [drive], config.huber, config.gate, factor)
    return float(seen.nis.mean()), seen.log_likelihood / len(seen.nis)


@pytest.mark.parametrize('factor', [WRONG, 1.0 / WRONG])
def test_tune_finds_noise_again_from_defaults_three_times_wrong(room, factor):
    """Within 10 % for ranges and 60 % for odometry; consistent on the data of another seed.

    480 ranges tell their own deviation to 1 / sqrt(2 * 480) = 3 %; what they tell of a step of
    odometry is what reaches beyond their own noise, 0.02 m of 0.08 m.
    """
    names = (RANGE_STD, 'motion.distance', 'motion.heading_per_turn', 'gyro_bias_walk')
    before = wrong(factor)
    found = tune(partial(make, room), before, [drawn(room, 1)], names)
    values = {item.name: item for item in found.parameters}
    assert values[RANGE_STD].before == before.default_range_std
    assert values[RANGE_STD].after == pytest.approx(0.08, rel=0.1)
    assert 0.08 / 1.6 < values['motion.distance'].after < 0.08 * 1.6
    assert 0.08 / 1.6 < values['motion.heading_per_turn'].after < 0.08 * 1.6
    assert found.config.motion.distance == values['motion.distance'].after
    assert found.config.default_range_std == pytest.approx(values[RANGE_STD].after)
    # A few ten seconds show nothing of how a gyro drifts.
    assert values['gyro_bias_walk'].after == before.gyro_bias_walk
    assert values['gyro_bias_walk'].verdict is Verdict.HELD
    other = drawn(room, 2)
    nis_before, likelihood_before = judged(room, before, other)
    nis_after, likelihood_after = judged(room, found.config, other)
    # Twice what chance makes of it: sqrt(2 / 480) there, and twice the 5 % of what was found here.
    assert abs(nis_after - 1.0) < 0.24 < abs(nis_before - 1.0)
    assert likelihood_after > likelihood_before + 0.1
    # As good as the truth itself, nearly.
    assert likelihood_after > judged(room, TRUE, other)[1] - 0.02


def test_tune_right_defaults_are_confirmed(room):
    """Nothing is tuned that need not be, and it is said what the data know."""
    names = (RANGE_STD, 'motion.distance', 'gyro_bias_walk', 'motion.heading_per_time')
    found = tune(partial(make, room), TRUE, [drawn(room, 3)], names)
    verdicts = {item.name: item.verdict for item in found.parameters}
    assert verdicts[RANGE_STD] is Verdict.CONFIRMED
    assert verdicts['motion.distance'] is Verdict.CONFIRMED
    assert verdicts['gyro_bias_walk'] is Verdict.HELD
    assert verdicts['motion.heading_per_time'] is Verdict.HELD
    assert found.config == TRUE
    factors = {item.name: item.factor for item in found.parameters}
    assert factors[RANGE_STD] < 1.06
    assert factors['gyro_bias_walk'] == pytest.approx(3.0, rel=0.05)


def test_tune_told_variances_are_scaled(room):
    """Ranges that come with a variance: the factor is for what makes them; blocked ones forgiven.

    Every twentieth range is up to 3 m too long.
    """
    drive = drawn(room, 4, told=0.24, blocked=0.05)
    found = tune(partial(make, room), TRUE, [drive], (RANGE_STD,))
    (item,) = found.parameters
    assert item.told
    assert item.before == pytest.approx(0.24)
    assert item.after == pytest.approx(0.08, rel=0.2)
    assert found.range_std_factor == pytest.approx(item.after / 0.24)


def test_tune_zero_stays_zero(room):
    config = set_parameters(TRUE, {'gyro_bias_walk': 0.0})
    found = tune(partial(make, room), config, [drawn(room, 5, 60)], ('gyro_bias_walk',))
    assert found.config == config
    assert found.parameters[0].after == 0.0


def test_tune_too_few_ranges_raises(room):
    with pytest.raises(TuningError, match='40 ranges are too few'):
        tune(partial(make, room), TRUE, [drawn(room, 1, 20)])


def test_tunable_names_are_parameters():
    """Each is a setting of its own, and keeps inside its bounds."""
    names = [name for name in TUNABLE if name != RANGE_STD]
    changed = set_parameters(EstimatorConfig(), dict.fromkeys(names, 1e-3))
    assert changed.motion == MotionNoise(1e-3, 1e-3, 1e-3, 1e-3)
    assert changed.range_bias_std == changed.gyro_bias_walk == changed.range_bias_walk == 1e-3
    assert set_parameters(EstimatorConfig(), {'gyro_bias_walk': 50.0}).gyro_bias_walk == 0.1


@pytest.mark.parametrize(('huber', 'gate'), [(1.5, 16.0), (1.0, 4.0), (100.0, 1e6)])
def test_scale_weight_makes_the_true_noise_the_likeliest(huber, gate):
    """For standard normal innovations the mean loss is least at a scale of 1."""
    z = np.linspace(-9.0, 9.0, 200_001)
    density = np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
    scales = np.linspace(0.8, 1.25, 91)
    weight = scale_weight(huber, gate)
    cost = [
        2.0 * weight * math.log(s) + np.trapezoid(robust_loss(z / s, huber, gate) * density, z)
        for s in scales
    ]
    assert scales[int(np.argmin(cost))] == pytest.approx(1.0, abs=0.006)


def test_drive_of_a_recorded_run_is_the_run(room):
    """From its own start, without the lead-in, a drive gives the estimates of the run again."""
    config = LocalizerConfig(tag_position=room.lever, initial_pose=(4.0, 3.0, 0.8))
    localizer = RecordingLocalizer(config, room.anchors)
    drive = room.drive(1, 10.0)
    for sample in sorted([*drive.odometry, *drive.ranges], key=lambda item: item.stamp):
        if isinstance(sample, OdometrySample):
            localizer.add_odometry(sample)
        else:
            localizer.add_range(sample)
    (run,) = localizer.runs()
    taken = drive_of(run)
    seen = run_drives(make(room, config.filter), [taken], config.filter.huber, config.filter.gate)
    estimate, spreads = run.first, []
    for step in run.steps:
        if step.motion is not None:
            estimate = run.estimator.predict(estimate, step.motion, step.stamp)
        if step.measurement is not None:
            estimate, innovation = run.estimator.update(estimate, step.measurement)
            spreads.append((innovation.innovation[0], innovation.covariance[0, 0]))
    # Steps of 20 ms are put together between ranges 40 ms apart: the same arc, nearly.
    np.testing.assert_allclose(seen.innovations, np.array(spreads)[:, 0], atol=1e-4)
    np.testing.assert_allclose(seen.variances, np.array(spreads)[:, 1], rtol=1e-3)
    assert len(taken.steps) < len(run.steps)


def test_drive_of_a_run_that_found_its_start_takes_the_window_too(room):
    """The ranges that the start was found from are judged as well, from where they began."""
    localizer = RecordingLocalizer(LocalizerConfig(tag_position=room.lever), room.anchors)
    drive = room.drive(2, 10.0)
    for sample in sorted([*drive.odometry, *drive.ranges], key=lambda item: item.stamp):
        if isinstance(sample, OdometrySample):
            localizer.add_odometry(sample)
        else:
            localizer.add_range(sample)
    (run,) = localizer.runs()
    taken = drive_of(run)
    ranges = [sample for step in taken.steps for sample in step.ranges]
    first = drive.odometry[0].stamp
    expected = [sample for sample in drive.ranges if sample.stamp >= first]
    # The range that settled the start was ahead of the odometry that the start is placed at.
    ahead = next(sample for sample in expected if sample.stamp > run.start.stamp)
    assert [sample for sample in expected if sample not in ranges] == [ahead]
    assert [sample for sample in expected if sample in ranges] == ranges
    assert taken.start.stamp == first
    true = drive.truth[first]
    assert np.hypot(taken.start.pose[0] - true.x, taken.start.pose[1] - true.y) < 0.3
    driven = sum(step.motion.dt_s for step in taken.steps if step.motion is not None)
    assert driven == pytest.approx((drive.odometry[-1].stamp - first) * 1e-9)
    config = EstimatorConfig()
    seen = run_drives(make(room, config), [taken], config.huber, config.gate)
    assert seen.accepted.mean() > 0.98
    assert 0.7 < seen.nis.mean() < 1.3
