"""The list of anchors: tablerunner_interfaces/UwbAnchorArray and Anchor records."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tablerunner.messages.anchors import anchors_from_message
from tablerunner.types import Anchor
from tablerunner_interfaces.msg import UwbAnchor, UwbAnchorArray
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['anchors_from_message', 'anchors_to_message']


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
