"""UWB ranges: tablerunner_interfaces/UwbRange as RangeSample."""

from __future__ import annotations

from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import LosState, RangeSample, Refusal

SOURCE = 'uwb/ranges'
_LOS = {int(state): state for state in LosState}


def range_from_message(message: Any) -> RangeSample | Refusal:
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
