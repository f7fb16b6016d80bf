"""What a measurement did to the estimate: tablerunner_interfaces/Innovation and Innovation."""

from __future__ import annotations

from array import array

import numpy as np
from tablerunner_interfaces.msg import Innovation as InnovationMessage

from tablerunner.types import Innovation
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message


def innovation_to_message(record: Innovation, frame: str, estimator: str) -> InnovationMessage:
    """Return an innovation as a message; `frame` is that of the estimate."""
    message = InnovationMessage()
    fill_stamp(message.header.stamp, record.stamp)
    message.header.frame_id = frame
    message.source = record.source
    message.key = record.key
    message.estimator = estimator
    # array('d', ndarray) would walk the elements one by one.
    message.innovation = array('d', record.innovation.tobytes())
    message.variance = array('d', record.covariance.tobytes())
    message.nis = record.nis
    message.gate = record.gate
    message.accepted = record.accepted
    message.reason = record.reason
    return message


def innovation_from_message(message: InnovationMessage) -> Innovation:
    """Return the innovation of a message."""
    size = len(message.innovation)
    return Innovation(
        stamp=stamp_from_message(message.header.stamp),
        source=message.source,
        key=message.key,
        accepted=message.accepted,
        reason=message.reason,
        innovation=np.array(message.innovation, dtype=np.float64),
        covariance=np.array(message.variance, dtype=np.float64).reshape(
            (size, size) if len(message.variance) == size * size else (0, 0)
        ),
        nis=message.nis,
        gate=message.gate,
    )
