"""UWB exchanges: tablerunner_interfaces/UwbExchange and ExchangeSample."""

from __future__ import annotations

from tablerunner.messages.exchange import exchange_from_message
from tablerunner.types import ExchangeSample
from tablerunner_interfaces.msg import UwbExchange
from tablerunner_ros.conversions.stamp import fill_stamp

__all__ = ['exchange_from_message', 'exchange_to_message']


def exchange_to_message(sample: ExchangeSample, frame: str) -> UwbExchange:
    """Return an exchange as a message; `frame` is that of the tag's antenna."""
    message = UwbExchange()
    fill_stamp(message.header.stamp, sample.stamp)
    message.header.frame_id = frame
    message.anchor_id = sample.anchor_id
    message.tag_id = sample.tag_id
    message.sequence = sample.sequence
    message.poll_tx = sample.poll_tx
    message.poll_rx = sample.poll_rx
    message.response_tx = sample.response_tx
    message.response_rx = sample.response_rx
    message.final_tx = sample.final_tx
    message.final_rx = sample.final_rx
    message.rx_power = sample.rx_power_dbm
    message.first_path_power = sample.first_path_power_dbm
    return message
