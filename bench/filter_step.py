"""One step of the EKF (predict and one range) against filterpy's on the same model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from result import Result

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.models.motion_model import move, state_jacobian
from tablerunner.estimation.models.range_model import predict_range
from tablerunner.odometry import Motion
from tablerunner.types import Anchor, RangeSample

STEPS = 4000
ROUNDS = 5
LEVER = (0.0, 0.0, 1.1)
ANCHORS = tuple(
    Anchor(f'A{i}', place)
    for i, place in enumerate(
        [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]
    )
)
CONFIG = EstimatorConfig(huber=100.0, gate=1e6)
MOTION = Motion(0.01, 0.002, 0.02)
START = Start(1, np.array([5.0, 6.0, 0.3]), np.eye(3) * 0.01)


def ours() -> None:
    """Run our filter."""
    ekf = Ekf(CONFIG, ANCHORS, LEVER)
    estimate = ekf.start(START)
    for k in range(STEPS):
        estimate = ekf.predict(estimate, MOTION, k + 2)
        sample = RangeSample(k + 2, f'A{k % 4}', 'tag', k, 8.0, 0.01)
        estimate, _ = ekf.update(estimate, sample)


def filterpy() -> None:
    """Run filterpy's filter on our models, as its documentation shows."""
    first = Ekf(CONFIG, ANCHORS, LEVER).start(START)
    ekf = ExtendedKalmanFilter(dim_x=len(first.mean), dim_z=1)
    ekf.x, ekf.P = first.mean.copy(), first.covariance.copy()
    ekf.R = np.array([[0.01]])
    size = len(first.mean)
    walk = np.zeros(size)
    walk[3] = CONFIG.scale_walk**2 * MOTION.distance_m
    walk[4] = CONFIG.gyro_bias_walk**2 * MOTION.dt_s
    walk[5:] = CONFIG.range_bias_walk**2 * MOTION.dt_s
    distance, turn = CONFIG.motion.variances(MOTION)
    moved = ekf.x

    def predict_x(_control: object = 0) -> None:
        ekf.x = moved

    ekf.predict_x = predict_x
    for k in range(STEPS):
        moved, coupling, by_input = move(ekf.x, MOTION)
        noise = np.diag(walk)
        noise[:3, :3] += by_input @ np.diag([distance, turn]) @ by_input.T
        ekf.F, ekf.Q = state_jacobian(coupling, size), noise
        ekf.predict()
        anchor, index = ANCHORS[k % 4].position, k % 4
        ekf.update(
            np.array([8.0]),
            lambda x, a=anchor, i=index: predict_range(x, a, LEVER, i)[1][None],
            lambda x, a=anchor, i=index: np.array([predict_range(x, a, LEVER, i)[0]]),
        )


def best(run: Callable[[], None]) -> float:
    """Return the shortest of several runs [s]: the one that was disturbed least."""
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return min(times)


def measure() -> Iterator[Result]:
    """Measure both."""
    our_step, reference = best(ours) / STEPS * 1e6, best(filterpy) / STEPS * 1e6
    yield Result(
        'ekf step',
        our_step,
        reference,
        our_step / reference,
        'us',
        'predict and one range, 9 states; reference: filterpy on the same model',
        bound=1.0,
    )
