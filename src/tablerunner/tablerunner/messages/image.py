"""Pictures: sensor_msgs/Image as ImageSample, without cv_bridge."""

from __future__ import annotations

from typing import Any

import numpy as np

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import ImageSample, Refusal

SOURCE = 'camera/image_raw'

CHANNELS = {'bgr8': (0, 1, 2), 'rgb8': (2, 1, 0), 'bgra8': (0, 1, 2), 'rgba8': (2, 1, 0)}
"""Where blue, green and red stand in each encoding that is read."""


def image_from_message(message: Any, source: str = SOURCE) -> ImageSample | Refusal:
    """Return a colour picture; one in grey, raw (Bayer) or compressed colours is refused.

    Parameters
    ----------
    message : sensor_msgs.msg.Image
    source : str
        Topic it came from.
    """
    stamp = stamp_from_message(message.header.stamp)
    order = CHANNELS.get(message.encoding)
    if order is None:
        return Refusal(stamp, source, '', 'encoding is not one of ' + ', '.join(CHANNELS))
    height, width, step = message.height, message.width, message.step
    depth = len(message.encoding) - 1
    if height < 1 or width < 1:
        return Refusal(stamp, source, '', 'picture without pixels')
    if step < width * depth:
        return Refusal(stamp, source, '', 'step is shorter than a row')
    data = np.frombuffer(message.data, dtype=np.uint8)
    if len(data) != step * height:
        return Refusal(stamp, source, '', 'data is not as long as step and height say')
    rows = data.reshape(height, step)[:, : width * depth].reshape(height, width, depth)
    if order == (0, 1, 2) and depth == 3:
        return ImageSample(stamp, rows)
    return ImageSample(stamp, np.ascontiguousarray(rows[..., list(order)]))
