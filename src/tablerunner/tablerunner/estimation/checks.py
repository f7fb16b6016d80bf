"""What a measurement must satisfy before an estimator sees it."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from tablerunner.types import PoseSample, RangeSample


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
    if not (math.isfinite(sample.variance_m2) and sample.variance_m2 >= 0.0):
        return 'variance not positive'
    if not (math.isnan(sample.nlos_probability) or 0.0 <= sample.nlos_probability <= 1.0):
        return 'nlos probability outside 0 to 1'
    return ''


def check_pose(sample: PoseSample) -> str:
    """Return why a pose cannot be used; '' if it can. Infinite variance of heading: no heading."""
    if sample.stamp <= 0:
        return 'zero stamp'
    if not sample.pose.is_finite:
        return 'pose not finite'
    rows = 3 if math.isfinite(sample.covariance[2, 2]) else 2
    covariance = sample.covariance[:rows, :rows]
    if not np.all(np.isfinite(covariance)):
        return 'covariance not finite'
    if np.any(np.diagonal(covariance) <= 0.0):
        return 'variance not positive'
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12):
        return 'covariance not symmetric'
    if np.linalg.eigvalsh(covariance)[0] < 0.0:
        return 'covariance not positive semi-definite'
    return ''
