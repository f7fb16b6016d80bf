"""Ultrasonic sensors: sensor_msgs/Range and UltrasonicSample."""

from __future__ import annotations

import math

from sensor_msgs.msg import Range

from tablerunner.types import Refusal, UltrasonicSample
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

SOURCE = 'ultrasonic'


def ultrasonic_from_message(message: Range) -> UltrasonicSample | Refusal:
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


def ultrasonic_to_message(sample: UltrasonicSample) -> Range:
    """Return a reading as a message; its frame is the sensor's name."""
    message = Range()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = sample.sensor
    message.radiation_type = Range.ULTRASOUND
    message.field_of_view = sample.field_of_view_rad
    message.min_range = sample.min_range_m
    message.max_range = sample.max_range_m
    message.range = sample.range_m
    return message
