"""Steps of the EKF (predict, and one or four ranges) against filterpy's on the same model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from result import Result

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.models.motion_model import input_noise, move
from tablerunner.estimation.models.range_model import predict_ranges
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
)
from tablerunner.odometry import Motion
from tablerunner.types import Anchor, RangeSample

STEPS = 1000
ROUNDS, ROUND_STEPS = 60, 200  # short, so that some are undisturbed on a busy machine
LEVER = (0.0, 0.0, 1.1)
ANCHORS = tuple(
    Anchor(f'A{i}', place)
    for i, place in enumerate(
        [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]
    )
)
CONFIG = EstimatorConfig(huber=100.0, gate=1e6, persistence=4.0, doubt=4.0)
MOTION = Motion(1e-4, 0.002, 0.02)  # nearly on the spot, where the ranges say it is
START = Start(1, np.array([5.0, 6.0, 0.3]), np.eye(3) * 0.01)
VARIANCE = 0.01
PLACE = (5.2, 6.1, 1.1)
NOISE = (0.05, -0.08, 0.02, 0.06)


SAMPLES = tuple(
    RangeSample(
        1, anchor.anchor_id, 'tag', k, math.dist(anchor.position, PLACE) + NOISE[k], VARIANCE
    )
    for k, anchor in enumerate(ANCHORS)
)


class Ours:
    """Our filter, `count` ranges in each step."""

    def __init__(self, count: int) -> None:
        self._ekf = Ekf(CONFIG, ANCHORS, LEVER)
        self._samples = SAMPLES[:count]
        self.estimate = self._ekf.start(START)

    def run(self, steps: int) -> None:
        """Do some steps."""
        ekf, samples, estimate = self._ekf, self._samples, self.estimate
        for k in range(steps):
            estimate = ekf.predict(estimate, MOTION, k + 2)
            if len(samples) == 1:
                estimate, _ = ekf.update(estimate, samples[0])
            else:
                estimate, _ = ekf.update_ranges(estimate, samples)
        self.estimate = estimate


class Filterpy:
    """filterpy's filter on our models, as its documentation shows.

    Ranges of one instant are linearised at one place, as ours are, and taken one after the other,
    or `stacked` as one measurement of several numbers.
    """

    def __init__(self, count: int, stacked: bool = False) -> None:
        first = Ekf(CONFIG, ANCHORS, LEVER).start(START)
        size = count if stacked else 1
        self.ekf = ekf = ExtendedKalmanFilter(dim_x=len(first.mean), dim_z=size)
        ekf.x, ekf.P = first.mean.copy(), first.covariance.copy()
        ekf.R = np.eye(size) * VARIANCE
        ekf.predict_x = self._predict_x
        self._moved = ekf.x
        self._stacked = stacked
        self._anchors = [(anchor.position, i) for i, anchor in enumerate(ANCHORS[:count])]
        self._measured = np.array([sample.range_m for sample in SAMPLES[:count]])
        self._walk = walk = np.zeros(len(first.mean))
        walk[SCALE] = CONFIG.scale_walk**2 * MOTION.distance_m
        walk[TURN_SCALE] = CONFIG.turn_scale_walk**2 * MOTION.turn_rad
        walk[GYRO_BIAS] = CONFIG.gyro_bias_walk**2 * MOTION.dt_s
        walk[RANGE_DELAY] = CONFIG.range_delay_walk**2 * MOTION.dt_s
        walk[RANGE_BIAS : RANGE_BIAS + 4] = CONFIG.range_bias_walk**2 * MOTION.dt_s
        self._variances = CONFIG.motion.variances(MOTION)

    def _predict_x(self, _control: object = 0) -> None:
        self.ekf.x = self._moved

    def run(self, steps: int) -> None:
        """Do some steps."""
        ekf, measured = self.ekf, self._measured
        for _ in range(steps):
            self._moved, ekf.F, by_input = move(ekf.x, MOTION)
            ekf.Q = np.diag(self._walk)
            input_noise(ekf.Q, by_input, *self._variances)
            ekf.predict()
            twist = (
                (1.0 + ekf.x[SCALE]) * MOTION.distance_m / MOTION.dt_s,
                (1.0 + ekf.x[TURN_SCALE]) * MOTION.turn_rad / MOTION.dt_s - ekf.x[GYRO_BIAS],
            )
            place = ekf.x
            ranges, slopes = predict_ranges(place, self._anchors, LEVER, twist)
            expected = np.array(ranges)
            if self._stacked:
                ekf.update(measured, lambda x, h=slopes: h, lambda x, e=expected: e)
                continue
            for row in range(len(ranges)):
                ekf.update(
                    measured[row : row + 1],
                    lambda x, h=slopes[row : row + 1]: h,
                    lambda x, h=slopes[row], e=expected[row], at=place: np.array(
                        [e + h.dot(x - at)]
                    ),
                )


def compare(count: int) -> tuple[float, float, float]:
    """Return the times of a step [us], ours and filterpy's two: the least of rounds in turn.

    Raises
    ------
    RuntimeError
        They do not give the same numbers.
    """
    mine, theirs, stacked = Ours(count), Filterpy(count), Filterpy(count, stacked=True)
    mine.run(STEPS)
    theirs.run(STEPS)
    stacked.run(STEPS)
    apart = max(
        float(np.abs(mine.estimate.mean - theirs.ekf.x).max()),
        float(np.abs(mine.estimate.covariance - theirs.ekf.P).max()),
    )
    if not apart < 1e-9:
        raise RuntimeError(f'ekf and filterpy differ by {apart:.3g} after {STEPS} steps')
    times = [[_seconds(one.run) for one in (mine, theirs, stacked)] for _ in range(ROUNDS)]
    one, two, three = np.min(times, axis=0) / ROUND_STEPS * 1e6
    return float(one), float(two), float(three)


def _seconds(run: Callable[[int], None]) -> float:
    begun = time.process_time()
    run(ROUND_STEPS)
    return time.process_time() - begun


def measure() -> Iterator[Result]:
    """Measure all."""
    one, reference, _ = compare(1)
    yield Result(
        'ekf step',
        one,
        reference,
        one / reference,
        'us',
        'predict and one range, 15 states; reference: filterpy on the same model',
        bound=1.0,
    )
    four, reference, stacked = compare(4)
    what = 'predict and four ranges of one instant, 15 states; equal to 1e-9; reference: filterpy'
    yield Result(
        'ekf step with four ranges',
        four,
        reference,
        reference / four,
        'us',
        f'{what}, range by range',
        bound=3.0,
        at_most=False,
    )
    yield Result(
        'ekf step with four ranges, stacked',
        four,
        stacked,
        stacked / four,
        'us',
        f'{what}, all as one measurement',
        bound=1.0,
        at_most=False,
    )
