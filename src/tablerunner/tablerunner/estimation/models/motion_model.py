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

from tablerunner.estimation.models.state import GYRO_BIAS, HEADING, RANGE_BIAS, SCALE, X, Y
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
    coupling : ndarray, shape (3, 3)
        What d(moved)/d(mean) has beyond the identity: rows x, y, heading; columns heading, scale,
        gyro_bias. See `state_jacobian`, `transport`.
    by_input : ndarray, shape (3, 2)
        d(x, y, heading)/d(distance, turn).
    """
    drift_s = 0.0 if motion.distance_m == 0.0 and motion.turn_rad == 0.0 else motion.dt_s
    x, y, heading, scale, gyro_bias = mean[:5].tolist()
    turn = motion.turn_rad - gyro_bias * drift_s
    cos, sin = math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn)
    step_x, step_y = motion.distance_m * cos, motion.distance_m * sin
    dx, dy = (1.0 + scale) * step_x, (1.0 + scale) * step_y
    moved = mean.copy()
    moved[:3] = x + dx, y + dy, wrap(heading + turn)
    half_x, half_y = 0.5 * dx, 0.5 * dy
    coupling = np.array(
        [
            [-dy, step_x, half_y * drift_s],
            [dx, step_y, -half_x * drift_s],
            [0.0, 0.0, -drift_s],
        ]
    )
    by_input = np.array(
        [[(1.0 + scale) * cos, -half_y], [(1.0 + scale) * sin, half_x], [0.0, 1.0]]
    )
    return moved, coupling, by_input


def move_many(means: Matrix, motion: Motion) -> Matrix:
    """Return many moved states at once, shape (k, n); headings go on beyond pi, not wrapped.

    Parameters
    ----------
    means : ndarray, shape (k, n)
        States as in `models.state`.
    motion : Motion
        Odometry over the step, the same for all.
    """
    drift_s = 0.0 if motion.distance_m == 0.0 and motion.turn_rad == 0.0 else motion.dt_s
    turn = motion.turn_rad - means[:, GYRO_BIAS] * drift_s
    middle = means[:, HEADING] + 0.5 * turn
    length = (1.0 + means[:, SCALE]) * motion.distance_m
    moved: Matrix = np.array(means)
    moved[:, X] += length * np.cos(middle)
    moved[:, Y] += length * np.sin(middle)
    moved[:, HEADING] += turn
    return moved


def state_jacobian(coupling: Matrix, size: int) -> Matrix:
    """Return d(moved)/d(mean), shape (size, size), from the coupling of `move`."""
    jacobian = np.eye(size)
    jacobian[:3, HEADING:RANGE_BIAS] += coupling
    return jacobian


def transport(covariance: Matrix, coupling: Matrix, noise: Matrix) -> Matrix:
    """Return F P F' + Q for F = I + coupling, touching only the rows and columns that change.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        P, symmetric.
    coupling : ndarray, shape (3, 3)
        As returned by `move`.
    noise : ndarray, shape (3, 3)
        Q of x, y, heading, symmetric; the other states get none here.

    Returns
    -------
    moved : ndarray, shape (n, n)
        Symmetric to the last bit.
    """
    rows = covariance[:3] + coupling @ covariance[HEADING:RANGE_BIAS]
    corner = rows[:, :3] + rows[:, HEADING:RANGE_BIAS] @ coupling.T + noise
    moved: Matrix = covariance.copy()
    moved[:3] = rows
    moved[:, :3] = rows.T
    moved[:3, :3] = 0.5 * (corner + corner.T)
    return moved
