"""How the state moves with odometry.

With arc length ds and turn dtheta from odometry over dt, scale error s and rate bias b:

    turn     = dtheta - b dt
    heading' = heading + turn
    x'       = x + (1 + s) ds cos(heading + turn/2)
    y'       = y + (1 + s) ds sin(heading + turn/2)

While odometry says that nothing moved at all, the bias does not turn the robot either: dead
reckoning holds the heading at standstill. The other states stay (they walk; see the filter).
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.models.state import GYRO_BIAS, HEADING, SCALE, X, Y
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Matrix, Vector


def move(mean: Vector, motion: Motion) -> tuple[Vector, Matrix, Matrix]:
    """Return the moved state and the Jacobians of the motion.

    Parameters
    ----------
    mean : ndarray, shape (n,)
        State as in `models.state`.
    motion : Motion
        Odometry over the step.

    Returns
    -------
    moved : ndarray, shape (n,)
    by_state : ndarray, shape (n, n)
        d(moved)/d(mean).
    by_input : ndarray, shape (3, 2)
        d(x, y, heading)/d(distance, turn).
    """
    size = len(mean)
    drift_s = 0.0 if motion.distance_m == 0.0 and motion.turn_rad == 0.0 else motion.dt_s
    scale = 1.0 + float(mean[SCALE])
    turn = motion.turn_rad - float(mean[GYRO_BIAS]) * drift_s
    heading = float(mean[HEADING])
    cos, sin = math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn)
    dx, dy = scale * motion.distance_m * cos, scale * motion.distance_m * sin

    moved = mean.copy()
    moved[X] += dx
    moved[Y] += dy
    moved[HEADING] = wrap(heading + turn)

    by_state = np.eye(size)
    by_state[X, HEADING], by_state[Y, HEADING] = -dy, dx
    by_state[X, SCALE], by_state[Y, SCALE] = motion.distance_m * cos, motion.distance_m * sin
    by_state[X, GYRO_BIAS], by_state[Y, GYRO_BIAS] = 0.5 * dy * drift_s, -0.5 * dx * drift_s
    by_state[HEADING, GYRO_BIAS] = -drift_s
    by_input = np.array([[scale * cos, -0.5 * dy], [scale * sin, 0.5 * dx], [0.0, 1.0]])
    return moved, by_state, by_input
