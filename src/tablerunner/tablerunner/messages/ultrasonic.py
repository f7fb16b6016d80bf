"""Ultrasonic sensors: sensor_msgs/Range as UltrasonicSample."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Refusal, UltrasonicSample

SOURCE = 'ultrasonic'


def ultrasonic_from_message(message: Any) -> UltrasonicSample | Refusal:
    """Return a reading. REP-117: +inf is "nothing there", -inf "too near to measure", NaN a fault.

    Too near is an obstacle at the sensor's least distance, never a free way.
    """
    stamp = stamp_from_message(message.header.stamp)
    sensor = message.header.frame_id
    distance = message.range
    limits = (message.min_range, message.max_range, message.field_of_view)
    if not all(math.isfinite(limit) and limit >= 0.0 for limit in limits):
        return Refusal(stamp, SOURCE, sensor, 'limits of the sensor are not finite')
    if math.isnan(distance):
        return Refusal(stamp, SOURCE, sensor, 'range is not a number')
    if distance == -math.inf:
        distance = message.min_range
    elif distance < 0.0:
        return Refusal(stamp, SOURCE, sensor, 'negative range')
    return UltrasonicSample(stamp, sensor, distance, *limits)
