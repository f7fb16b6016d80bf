"""The course: the direction from one place to the next (6), for a marker that shows no heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.config import Config, parameter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CourseConfig(Config):
    """When two places tell a heading."""

    use: bool = parameter(
        True, description='Whether the course gives the heading where the marker shows none'
    )
    least_distance: float = parameter(
        0.03,
        unit='m',
        description='Way between two places from which it gives a course',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    longest_gap: float = parameter(
        0.5,
        unit='s',
        description='Time between two places up to which it does',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    turn_rate: float = parameter(
        0.8,
        unit='rad/s',
        description='Usual turn rate: by half the turn on the way the course lags the heading',
        low=0.0,
        high=10.0,
        dynamic=True,
    )


def course(before: ArrayLike, after: ArrayLike) -> Array:
    """Return the directions from places to places (6), shape (...) [rad].

    The heading of a robot that drives forward; one that backs up looks the other way.

    Parameters
    ----------
    before, after : array_like, shape (..., 2)
        In map [m].
    """
    way = np.asarray(after, dtype=float) - np.asarray(before, dtype=float)
    return np.asarray(np.arctan2(way[..., 1], way[..., 0]))


def course_variance(
    before: float,
    after: float,
    distance: float,
    dt_s: float,
    turn_rate: float,
    lever: float = 0.0,
) -> float:
    """Return the variance of a course as a heading [rad^2].

    Parameters
    ----------
    before, after : float
        Variances of both places across the way [m^2].
    distance : float
        Between them [m].
    dt_s : float
        Time between them [s].
    turn_rate : float
        Deviation of the turn rate [rad/s].
    lever : float
        How far ahead of base_link the places are taken [m]: turning moves them aside.
    """
    lag = turn_rate * dt_s * (0.5 + abs(lever) / distance)
    return min((before + after) / distance**2 + lag**2, math.pi**2)
