"""UWB ranges: tablerunner_interfaces/UwbRange and RangeSample."""

from __future__ import annotations

from tablerunner.messages.uwb_range import range_from_message
from tablerunner.types import RangeSample
from tablerunner_interfaces.msg import UwbRange
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['fill_range', 'range_from_message', 'range_to_message']


def range_to_message(sample: RangeSample, frame: str) -> UwbRange:
    """Return a range as a message; `frame` is that of the tag's antenna."""
    message = UwbRange()
    message.header.frame_id = frame
    fill_range(message, sample)
    return message


def fill_range(message: UwbRange, sample: RangeSample) -> None:
    """Write a range into a message that has its frame already."""
    fill_stamp(message.header.stamp, sample.stamp)
    message.anchor_id = sample.anchor_id
    message.tag_id = sample.tag_id
    message.sequence = sample.sequence
    message.range = sample.range_m
    message.variance = sample.variance_m2
    message.raw_range = sample.raw_range_m
    message.rx_power = sample.rx_power_dbm
    message.first_path_power = sample.first_path_power_dbm
    message.los = int(sample.los)
    message.nlos_probability = sample.nlos_probability
