"""Lv's corner model (10) and speed model (11): what the rule tables were made after."""

from __future__ import annotations

import numpy as np

from tablerunner.types import Vector


def corner_model(
    target_angle: Vector | float,
    side_difference_m: Vector | float,
    target_intensity: float,
    obstacle_intensity: Vector | float,
    offset_m: float,
) -> Vector:
    """Return how far to turn by Lv (10) [rad], to the left positive.

    alpha = lambda_g phi + lambda_ob arctan(1 / (d_lr + e_0)) / 2. The paper prints 1/d_lr + e_0,
    which has no value where both sides are equally far; e_0 belongs below the line, and its sign
    is which way to turn then. (The minus side is mirrored, so that it stays below the line.)

    Parameters
    ----------
    target_angle : float or ndarray
        phi, direction of the target as seen from the robot [rad].
    side_difference_m : float or ndarray
        d_lr, left front less right front distance [m].
    target_intensity, obstacle_intensity : float
        lambda_g and lambda_ob; the second is 0 where nothing is in the way.
    offset_m : float
        e_0 [m], above 0: to the left where both sides are equally far.
    """
    apart = np.asarray(side_difference_m, dtype=float)
    apart = np.where(apart < 0.0, apart - offset_m, apart + offset_m)
    away = np.asarray(obstacle_intensity) * np.arctan(1.0 / apart) / 2.0
    return np.asarray(target_intensity * np.asarray(target_angle) + away)


def speed_model(
    target_distance_m: Vector | float,
    obstacle_distance_m: Vector | float,
    target_gain: float,
    obstacle_gain: float,
    least_m_s: float,
    max_m_s: float,
) -> Vector:
    """Return how fast to drive by Lv (11) [m/s]: min(k_g d_g, v_max, k_ob d_ob + v_0).

    Parameters
    ----------
    target_distance_m, obstacle_distance_m : float or ndarray
        d_g and d_ob [m].
    target_gain, obstacle_gain : float
        k_g and k_ob [1/s].
    least_m_s, max_m_s : float
        v_0, the speed right at an obstacle, and v_max [m/s].
    """
    to_target = target_gain * np.asarray(target_distance_m, dtype=float)
    to_obstacle = obstacle_gain * np.asarray(obstacle_distance_m, dtype=float) + least_m_s
    return np.minimum(np.minimum(to_target, max_m_s), to_obstacle)
