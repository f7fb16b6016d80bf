"""The list of anchors: tablerunner_interfaces/UwbAnchorArray as Anchor records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Anchor, Refusal

SOURCE = 'uwb/anchors'


def anchors_from_message(message: Any, frame: str = '') -> tuple[Anchor, ...] | Refusal:
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
