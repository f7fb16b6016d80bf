"""Layout of the robot's state vector, shared by the filters that carry it.

``[x, y, heading, scale, turn_scale, gyro_bias, range_delay,
range_bias of each anchor ..., range_scale of each anchor ...]``

==============  ===  ==========================================================================
scale           1    by what share the wheels roll farther than they say
turn_scale      1    the same for turns: error of the track, or of the gyroscope's scale
gyro_bias       rad/s  what is left of the bias of the yaw rate
range_delay     s    by how much the stamps of ranges are later than the ranging was
range_bias      m    by how much an anchor reads too long
range_scale     1    the same in proportion to the distance
==============  ===  ==========================================================================
"""

from __future__ import annotations

X, Y, HEADING, SCALE, TURN_SCALE, GYRO_BIAS, RANGE_DELAY, RANGE_BIAS = range(8)
"""Indices; RANGE_BIAS is the first of as many as there are anchors, their scales follow."""

BASE_NAMES = ('x', 'y', 'heading', 'scale', 'turn_scale', 'gyro_bias', 'range_delay')


def state_names(anchor_ids: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of all states for the given anchors."""
    return (
        *BASE_NAMES,
        *(f'range_bias.{anchor_id}' for anchor_id in anchor_ids),
        *(f'range_scale.{anchor_id}' for anchor_id in anchor_ids),
    )


def range_scale(size: int) -> int:
    """Return the index of the first range scale of a state of so many numbers."""
    return (size + RANGE_BIAS) // 2
