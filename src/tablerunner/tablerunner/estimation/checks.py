"""What a measurement must satisfy before an estimator sees it."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from tablerunner.types import OdometrySample, PoseSample, RangeSample

FARTHEST_M = 1e5
"""No place, range or way indoors is farther: what is would only spoil the arithmetic."""

LEAST_VARIANCE = 1e-12
"""A micrometre, a microradian: who claims to know better takes all weight from the rest."""

MOST_VARIANCE = FARTHEST_M**2
"""Beyond that a measurement says nothing; infinity only stands for a heading that is missing."""

_SINGULAR = 1e-9
"""Least eigenvalue of correlations below which a direction counts as known without error."""


def check_odometry(sample: OdometrySample, max_speed: float, max_turn_rate: float) -> str:
    """Return why odometry cannot be used, whatever came before it; '' if it can.

    Its velocity [m/s, rad/s] carries the pose until the next sample.
    """
    if sample.stamp <= 0:
        return 'zero stamp'
    velocity = (sample.linear_m_s, sample.angular_rad_s)
    if not (sample.pose.is_finite and all(math.isfinite(part) for part in velocity)):
        return 'not finite'
    if max(abs(sample.pose.x), abs(sample.pose.y)) > FARTHEST_M:
        return 'too far away'
    if abs(sample.linear_m_s) > max_speed or abs(sample.angular_rad_s) > max_turn_rate:
        return 'velocity too high'
    return ''


def check_range(sample: RangeSample, known_anchors: Collection[str]) -> str:
    """Return why a range cannot be used; '' if it can.

    A variance of zero means unknown (the contract of UwbRange); anything below is refused.
    """
    if sample.stamp <= 0:
        return 'zero stamp'
    if sample.anchor_id not in known_anchors:
        return 'unknown anchor'
    if not math.isfinite(sample.range_m):
        return 'range not finite'
    if sample.range_m <= 0.0:
        return 'negative range'
    if sample.range_m > FARTHEST_M:
        return 'too far away'
    if not (math.isfinite(sample.variance_m2) and sample.variance_m2 >= 0.0):
        return 'variance not positive'
    if 0.0 < sample.variance_m2 < LEAST_VARIANCE:
        return 'variance too small'
    if sample.variance_m2 > MOST_VARIANCE:
        return 'variance too large'
    if not (math.isnan(sample.nlos_probability) or 0.0 <= sample.nlos_probability <= 1.0):
        return 'nlos probability outside 0 to 1'
    return ''


def check_pose(sample: PoseSample) -> str:
    """Return why a pose cannot be used; '' if it can. Infinite variance of heading: no heading."""
    if sample.stamp <= 0:
        return 'zero stamp'
    if not sample.pose.is_finite:
        return 'pose not finite'
    if max(abs(sample.pose.x), abs(sample.pose.y)) > FARTHEST_M:
        return 'too far away'
    rows = 3 if math.isfinite(sample.covariance[2, 2]) else 2
    covariance = sample.covariance[:rows, :rows]
    if not np.all(np.isfinite(covariance)):
        return 'covariance not finite'
    if np.any(np.diagonal(covariance) <= 0.0):
        return 'variance not positive'
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12):
        return 'covariance not symmetric'
    if np.any(np.diagonal(covariance) < LEAST_VARIANCE):
        return 'variance too small'
    if np.any(np.diagonal(covariance) > MOST_VARIANCE):
        return 'variance too large'
    deviations = np.sqrt(np.diagonal(covariance))
    least = np.linalg.eigvalsh(covariance / np.outer(deviations, deviations))[0]
    if least < -_SINGULAR:
        return 'covariance not positive semi-definite'
    return 'covariance singular' if least < _SINGULAR else ''
