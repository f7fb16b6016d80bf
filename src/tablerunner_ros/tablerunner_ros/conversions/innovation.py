"""What a measurement did to the estimate: tablerunner_interfaces/Innovation and Innovation."""

from __future__ import annotations

from array import array

from tablerunner.messages.innovation import innovation_from_message
from tablerunner.types import Innovation, Refusal
from tablerunner_interfaces.msg import Innovation as InnovationMessage
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['innovation_from_message', 'innovation_to_message', 'refusal_to_message']


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


def refusal_to_message(record: Refusal, frame: str, estimator: str) -> InnovationMessage:
    """Return a measurement that no estimator saw as a message: no numbers, only the reason."""
    unseen = Innovation(
        max(record.stamp, 0), record.source, record.key, False, record.reason, considered=False
    )
    return innovation_to_message(unseen, frame, estimator)
