"""The start from anywhere: where it may be, and when the particles have found the pose."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tablerunner.estimation.alignment import AlignmentConfig
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.types import UNKNOWN_YAW_VARIANCE, Anchor, Estimate

Room = tuple[float, float, float, float]
"""x and y from, x and y to [m]."""


def room_of(config: EstimatorConfig, anchors: Sequence[Anchor]) -> Room:
    """Return the room that is set, or what lies between the anchors and a margin about them."""
    settings = config.particles
    if settings.room:
        low_x, low_y, high_x, high_y = settings.room
        return low_x, low_y, high_x, high_y
    places = np.array([anchor.position[:2] for anchor in anchors] or [(0.0, 0.0)])
    low, high = (
        places.min(axis=0) - settings.room_margin,
        places.max(axis=0) + settings.room_margin,
    )
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def is_known(config: EstimatorConfig, anchors: Sequence[Anchor]) -> bool:
    """Whether there is a room to begin anywhere in: one that is set, or anchors."""
    return bool(config.particles.room) or bool(anchors)


def anywhere(config: EstimatorConfig, anchors: Sequence[Anchor], stamp: int) -> Start:
    """Return the start that knows nothing: the middle of the room, and how far it may be off."""
    low_x, low_y, high_x, high_y = room_of(config, anchors)
    covariance = np.diag(
        [(high_x - low_x) ** 2 / 12.0, (high_y - low_y) ** 2 / 12.0, UNKNOWN_YAW_VARIANCE]
    )
    middle = np.array([0.5 * (low_x + high_x), 0.5 * (low_y + high_y), 0.0])
    return Start(stamp, middle, covariance, anywhere=True)


def missing(estimate: Estimate, config: AlignmentConfig) -> str:
    """Return what a pose still lacks to be believed, for people; '' if nothing."""
    covariance = estimate.pose_covariance
    place = math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))
    if place > config.max_position_std:
        return f'position known to {place:.2f} m only'
    if covariance[2, 2] > config.max_heading_std**2:
        return 'heading unknown: drive'
    return ''
