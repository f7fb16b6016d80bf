"""Steps of the EKF (predict, and one or four ranges) against filterpy's on the same model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from result import Result

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.models.motion_model import input_noise, move
from tablerunner.estimation.models.range_model import predict_range
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
)
from tablerunner.odometry import Motion
from tablerunner.types import Anchor, Estimate, RangeSample

STEPS = 1000
ROUNDS = 9
LEVER = (0.0, 0.0, 1.1)
ANCHORS = tuple(
    Anchor(f'A{i}', place)
    for i, place in enumerate(
        [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]
    )
)
CONFIG = EstimatorConfig(huber=100.0, gate=1e6, persistence=4.0)
MOTION = Motion(0.01, 0.002, 0.02)
START = Start(1, np.array([5.0, 6.0, 0.3]), np.eye(3) * 0.01)
VARIANCE = 0.01


SAMPLES = tuple(
    RangeSample(1, anchor.anchor_id, 'tag', k, 8.0 + 0.1 * k, VARIANCE)
    for k, anchor in enumerate(ANCHORS)
)


def readings(step: int, count: int) -> list[int]:
    """Return which anchors are read after a step."""
    return [(step + k) % len(ANCHORS) for k in range(count)]


def ours(count: int) -> Estimate:
    """Run our filter."""
    ekf = Ekf(CONFIG, ANCHORS, LEVER)
    estimate = ekf.start(START)
    for k in range(STEPS):
        estimate = ekf.predict(estimate, MOTION, k + 2)
        for index in readings(k, count):
            estimate, _ = ekf.update(estimate, SAMPLES[index])
    return estimate


def filterpy(count: int) -> ExtendedKalmanFilter:
    """Run filterpy's filter on our models, as its documentation shows."""
    first = Ekf(CONFIG, ANCHORS, LEVER).start(START)
    ekf = ExtendedKalmanFilter(dim_x=len(first.mean), dim_z=1)
    ekf.x, ekf.P = first.mean.copy(), first.covariance.copy()
    ekf.R = np.array([[VARIANCE]])
    walk = np.zeros(len(first.mean))
    walk[SCALE] = CONFIG.scale_walk**2 * MOTION.distance_m
    walk[TURN_SCALE] = CONFIG.turn_scale_walk**2 * MOTION.turn_rad
    walk[GYRO_BIAS] = CONFIG.gyro_bias_walk**2 * MOTION.dt_s
    walk[RANGE_DELAY] = CONFIG.range_delay_walk**2 * MOTION.dt_s
    walk[RANGE_BIAS:] = CONFIG.range_bias_walk**2 * MOTION.dt_s
    variances = CONFIG.motion.variances(MOTION)
    moved = ekf.x

    def predict_x(_control: object = 0) -> None:
        ekf.x = moved

    ekf.predict_x = predict_x
    for k in range(STEPS):
        moved, ekf.F, by_input = move(ekf.x, MOTION)
        ekf.Q = np.diag(walk)
        input_noise(ekf.Q, by_input, *variances)
        ekf.predict()
        twist = (
            (1.0 + ekf.x[SCALE]) * MOTION.distance_m / MOTION.dt_s,
            (1.0 + ekf.x[TURN_SCALE]) * MOTION.turn_rad / MOTION.dt_s - ekf.x[GYRO_BIAS],
        )
        for index in readings(k, count):
            place = ANCHORS[index].position
            ekf.update(
                np.array([SAMPLES[index].range_m]),
                lambda x, a=place, i=index, t=twist: predict_range(x, a, LEVER, i, t)[1][None],
                lambda x, a=place, i=index, t=twist: np.array(
                    [predict_range(x, a, LEVER, i, t)[0]]
                ),
            )
    return ekf


def compare(count: int) -> tuple[float, float]:
    """Return the times of one step, ours and filterpy's [us]: the least of rounds in turn.

    Raises
    ------
    RuntimeError
        They do not give the same numbers.
    """
    mine, theirs = ours(count), filterpy(count)
    apart = max(
        float(np.abs(mine.mean - theirs.x).max()),
        float(np.abs(mine.covariance - theirs.P).max()),
    )
    if not apart < 1e-9:
        raise RuntimeError(f'ekf and filterpy differ by {apart:.3g} after {STEPS} steps')
    our_times, their_times = [], []
    for _ in range(ROUNDS):
        our_times.append(_seconds(ours, count))
        their_times.append(_seconds(filterpy, count))
    return min(our_times) / STEPS * 1e6, min(their_times) / STEPS * 1e6


def _seconds(run: Callable[[int], object], count: int) -> float:
    begun = time.process_time()
    run(count)
    return time.process_time() - begun


def measure() -> Iterator[Result]:
    """Measure both."""
    one, reference = compare(1)
    yield Result(
        'ekf step',
        one,
        reference,
        one / reference,
        'us',
        'predict and one range, 11 states; reference: filterpy on the same model',
        bound=1.0,
    )
    four, reference = compare(4)
    yield Result(
        'ekf step with four ranges',
        four,
        reference,
        reference / four,
        'us',
        'predict and four ranges, 11 states; reference: filterpy on the same model, equal to 1e-9',
        bound=3.0,
        at_most=False,
    )
