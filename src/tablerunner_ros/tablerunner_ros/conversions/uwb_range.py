"""UWB ranges: tablerunner_interfaces/UwbRange and RangeSample."""

from __future__ import annotations

from tablerunner_interfaces.msg import UwbRange

from tablerunner.types import LosState, RangeSample, Refusal
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message

SOURCE = 'uwb/ranges'
_LOS = {int(state): state for state in LosState}


def range_from_message(message: UwbRange) -> RangeSample | Refusal:
    """Return the range of a message; refused is a line-of-sight state that does not exist."""
    stamp = stamp_from_message(message.header.stamp)
    los = _LOS.get(message.los)
    if los is None:
        return Refusal(stamp, SOURCE, message.anchor_id, 'unknown line-of-sight state')
    return RangeSample(
        stamp=stamp,
        anchor_id=message.anchor_id,
        tag_id=message.tag_id,
        sequence=message.sequence,
        range_m=message.range,
        variance_m2=message.variance,
        raw_range_m=message.raw_range,
        rx_power_dbm=message.rx_power,
        first_path_power_dbm=message.first_path_power,
        los=los,
        nlos_probability=message.nlos_probability,
    )


def range_to_message(sample: RangeSample, frame: str) -> UwbRange:
    """Return a range as a message; `frame` is that of the tag's antenna."""
    message = UwbRange()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
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
    return message
