"""UWB exchanges: tablerunner_interfaces/UwbExchange as ExchangeSample."""

from __future__ import annotations

from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import ExchangeSample


def exchange_from_message(message: Any) -> ExchangeSample:
    """Return the exchange of a message."""
    return ExchangeSample(
        stamp=stamp_from_message(message.header.stamp),
        anchor_id=message.anchor_id,
        tag_id=message.tag_id,
        sequence=message.sequence,
        poll_tx=message.poll_tx,
        poll_rx=message.poll_rx,
        response_tx=message.response_tx,
        response_rx=message.response_rx,
        final_tx=message.final_tx,
        final_rx=message.final_rx,
        rx_power_dbm=message.rx_power,
        first_path_power_dbm=message.first_path_power,
    )
