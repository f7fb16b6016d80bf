"""The list of anchors: tablerunner_interfaces/UwbAnchorArray and Anchor records."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from tablerunner_interfaces.msg import UwbAnchor, UwbAnchorArray

from tablerunner.types import Anchor, Refusal
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

SOURCE = 'uwb/anchors'


def anchors_from_message(
    message: UwbAnchorArray, frame: str = ''
) -> tuple[Anchor, ...] | Refusal:
    """Return the anchors of a message; `frame` is the one expected, empty for any.

    The position variance kept is the largest of the three axes.
    """
    stamp = stamp_from_message(message.header.stamp)
    if frame and message.header.frame_id != frame:
        return Refusal(stamp, SOURCE, '', f'not in frame {frame}')
    anchors: list[Anchor] = []
    for item in message.anchors:
        place = (item.position.x, item.position.y, item.position.z)
        variance = float(np.max(np.asarray(item.covariance)[[0, 4, 8]]))
        if not all(math.isfinite(number) for number in (*place, item.bias, variance)):
            return Refusal(stamp, SOURCE, item.anchor_id, 'anchor is not finite')
        if variance < 0.0:
            return Refusal(stamp, SOURCE, item.anchor_id, 'negative variance')
        if any(item.anchor_id == other.anchor_id for other in anchors):
            return Refusal(stamp, SOURCE, item.anchor_id, 'anchor named twice')
        anchors.append(Anchor(item.anchor_id, place, item.bias, variance))
    return tuple(anchors)


def anchors_to_message(anchors: Iterable[Anchor], stamp: int, frame: str) -> UwbAnchorArray:
    """Return anchors as a message; `frame` is that of their positions."""
    message = UwbAnchorArray()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    for anchor in anchors:
        item = UwbAnchor(anchor_id=anchor.anchor_id, bias=float(anchor.bias_m))
        item.position.x, item.position.y, item.position.z = (float(v) for v in anchor.position)
        item.covariance = (np.eye(3) * anchor.position_variance_m2).ravel()
        message.anchors.append(item)
    return message
