"""Transforms: tf2_msgs/TFMessage as links of a tree of frames."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.geometry.frame_tree import Link
from tablerunner.geometry.rotation import rotation_of_quaternion
from tablerunner.messages.quaternion import heading_from_quaternion, quaternion_fault
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Refusal

SOURCE = 'tf'


def links_from_message(message: Any, source: str = SOURCE) -> tuple[Link | Refusal, ...]:
    """Return each transform of a message as a link, or why it is none."""
    return tuple(_link(item, source) for item in message.transforms)


def _link(message: Any, source: str) -> Link | Refusal:
    stamp = stamp_from_message(message.header.stamp)
    parent, child = message.header.frame_id, message.child_frame_id
    if not parent or not child or parent == child:
        return Refusal(stamp, source, child, 'a frame needs a name and another one as its parent')
    turn, place = message.transform.rotation, message.transform.translation
    if math.isnan(heading_from_quaternion(turn)):
        return Refusal(stamp, source, child, quaternion_fault(turn))
    translation = (float(place.x), float(place.y), float(place.z))
    if not all(map(math.isfinite, translation)):
        return Refusal(stamp, source, child, 'position is not finite')
    rotation = rotation_of_quaternion((turn.x, turn.y, turn.z, turn.w))
    return Link(parent, child, rotation, translation)
