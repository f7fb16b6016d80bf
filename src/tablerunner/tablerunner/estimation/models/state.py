"""Layout of the robot's state vector, shared by the filters that carry it.

``[x, y, heading, scale, gyro_bias, range_bias of each anchor ...]``
"""

from __future__ import annotations

X, Y, HEADING, SCALE, GYRO_BIAS, RANGE_BIAS = range(6)
"""Indices; RANGE_BIAS is the first of as many as there are anchors."""

BASE_NAMES = ('x', 'y', 'heading', 'scale', 'gyro_bias')


def state_names(anchor_ids: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of all states for the given anchors."""
    return BASE_NAMES + tuple(f'range_bias.{anchor_id}' for anchor_id in anchor_ids)
