"""How the state moves with odometry.

With arc length ds and turn dtheta from odometry over dt, scale errors s and k, rate bias b:

    turn     = (1 + k) dtheta - b dt
    heading' = heading + turn
    x'       = x + (1 + s) ds cos(heading + turn/2)
    y'       = y + (1 + s) ds sin(heading + turn/2)

A differential drive does not move sideways, so that odometry has nothing to say of it. While
odometry says that nothing moved at all, the bias does not turn the robot either: dead reckoning
holds the heading at standstill. The other states stay (they walk; see the filter).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    HEADING,
    SCALE,
    TURN_SCALE,
    X,
    Y,
)
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Matrix, Vector


class Moved(NamedTuple):
    """The moved state and how it hangs on what it was made of.

    Attributes
    ----------
    mean : ndarray, shape (n,)
    by_state : ndarray, shape (n, n)
        d(moved)/d(state).
    by_input : tuple
        d(x)/d(distance), d(y)/d(distance), d(x)/d(turn), d(y)/d(turn), d(heading)/d(turn).
    """

    mean: Vector
    by_state: Matrix
    by_input: tuple[float, float, float, float, float]


def move(mean: Vector, motion: Motion) -> Moved:
    """Return the moved state and the Jacobians of the motion.

    Parameters
    ----------
    mean : ndarray, shape (n,)
        State as in `models.state`.
    motion : Motion
        Odometry over the step.
    """
    # Plain floats and single elements: this runs for every odometry, and small arrays cost more
    # than the arithmetic in them.
    distance, told_turn = motion.distance_m, motion.turn_rad
    drift_s = 0.0 if distance == 0.0 and told_turn == 0.0 else motion.dt_s
    x, y, heading, scale, turn_scale, gyro_bias = mean[:6].tolist()
    turn = (1.0 + turn_scale) * told_turn - gyro_bias * drift_s
    cos, sin = math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn)
    step_x, step_y = distance * cos, distance * sin
    dx, dy = (1.0 + scale) * step_x, (1.0 + scale) * step_y
    moved = mean.copy()
    moved[X] = x + dx
    moved[Y] = y + dy
    moved[HEADING] = wrap(heading + turn)
    half_x, half_y = 0.5 * dx, 0.5 * dy
    by_state = _identity(len(mean)).copy()
    by_state[X, HEADING] = -dy
    by_state[Y, HEADING] = dx
    by_state[X, SCALE] = step_x
    by_state[Y, SCALE] = step_y
    by_state[X, TURN_SCALE] = -half_y * told_turn
    by_state[Y, TURN_SCALE] = half_x * told_turn
    by_state[HEADING, TURN_SCALE] = told_turn
    by_state[X, GYRO_BIAS] = half_y * drift_s
    by_state[Y, GYRO_BIAS] = -half_x * drift_s
    by_state[HEADING, GYRO_BIAS] = -drift_s
    turned = 1.0 + turn_scale
    return Moved(
        moved,
        by_state,
        (
            (1.0 + scale) * cos,
            (1.0 + scale) * sin,
            -half_y * turned,
            half_x * turned,
            turned,
        ),
    )


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
    turn = (1.0 + means[:, TURN_SCALE]) * motion.turn_rad - means[:, GYRO_BIAS] * drift_s
    middle = means[:, HEADING] + 0.5 * turn
    length = (1.0 + means[:, SCALE]) * motion.distance_m
    moved: Matrix = np.array(means)
    moved[:, X] += length * np.cos(middle)
    moved[:, Y] += length * np.sin(middle)
    moved[:, HEADING] += turn
    return moved


def input_noise(
    noise: Matrix, by_input: tuple[float, ...], distance_variance: float, turn_variance: float
) -> None:
    """Write G diag(variances) G' into the rows and columns of x, y, heading, in place.

    Parameters
    ----------
    noise : ndarray, shape (n, n)
    by_input : tuple
        As of `Moved`.
    distance_variance, turn_variance : float
        Of the distance [m^2] and the turn [rad^2] of the step.
    """
    gx, gy, ex, ey, turned = by_input
    noise[X, X] = gx * gx * distance_variance + ex * ex * turn_variance
    noise[Y, Y] = gy * gy * distance_variance + ey * ey * turn_variance
    noise[X, Y] = noise[Y, X] = gx * gy * distance_variance + ex * ey * turn_variance
    turn_variance *= turned
    noise[X, HEADING] = noise[HEADING, X] = ex * turn_variance
    noise[Y, HEADING] = noise[HEADING, Y] = ey * turn_variance
    noise[HEADING, HEADING] = turned * turn_variance


def transport(covariance: Matrix, by_state: Matrix, noise: Matrix) -> Matrix:
    """Return F P F' + Q, symmetric to the last bit.

    Parameters
    ----------
    covariance, noise : ndarray, shape (n, n)
        P and Q, symmetric to the last bit.
    by_state : ndarray, shape (n, n)
        F of `move`: the identity but for the rows of x, y, heading.
    """
    # `dot` takes half the time of `@` on matrices as small as these.
    moved: Matrix = by_state.dot(covariance).dot(by_state.T)
    # Only what belongs to the three rows can have been rounded differently on both sides.
    moved[3:, :3] = moved[:3, 3:].T
    moved[Y, X] = moved[X, Y]
    moved[HEADING, X] = moved[X, HEADING]
    moved[HEADING, Y] = moved[Y, HEADING]
    moved += noise
    return moved


@lru_cache(maxsize=8)
def _identity(size: int) -> Matrix:
    return np.eye(size)
