"""Lenses: sensor_msgs/CameraInfo as Lens."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Lens, Refusal

SOURCE = 'camera/camera_info'

MODEL = 'plumb_bob'


def lens_from_message(message: Any, source: str = SOURCE) -> Lens | Refusal:
    """Return the lens of a calibrated camera.

    Parameters
    ----------
    message : sensor_msgs.msg.CameraInfo
        K[0] of zero means "not calibrated", as the message defines.
    source : str
        Topic it came from.
    """
    stamp = stamp_from_message(message.header.stamp)
    k, d = [float(value) for value in message.k], [float(value) for value in message.d]
    if message.height < 1 or message.width < 1:
        return Refusal(stamp, source, '', 'camera without a size')
    if len(k) != 9 or not all(math.isfinite(value) for value in (*k, *d)):
        return Refusal(stamp, source, '', 'not finite')
    if k[0] == 0.0:
        return Refusal(stamp, source, '', 'camera is not calibrated')
    if k[0] < 0.0 or k[4] <= 0.0:
        return Refusal(stamp, source, '', 'focal length is not above 0')
    if d and (message.distortion_model != MODEL or len(d) != 5):
        return Refusal(stamp, source, '', f'distortion is not {MODEL} with 5 numbers')
    roi = message.roi
    cropped = roi.width not in (0, message.width) or roi.height not in (0, message.height)
    if cropped or message.binning_x > 1 or message.binning_y > 1:
        return Refusal(stamp, source, '', 'pictures are binned or cropped')
    k1, k2, p1, p2, k3 = d or [0.0] * 5
    return Lens(message.width, message.height, (k[0], k[4]), (k[2], k[5]), (k1, k2, p1, p2, k3))
