"""Ultrasonic sensors: sensor_msgs/Range and UltrasonicSample."""

from __future__ import annotations

from sensor_msgs.msg import Range

from tablerunner.messages.ultrasonic import ultrasonic_from_message
from tablerunner.types import UltrasonicSample
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['ultrasonic_from_message', 'ultrasonic_to_message']


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
