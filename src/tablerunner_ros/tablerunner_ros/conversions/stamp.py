"""Stamps: builtin_interfaces/Time and integer nanoseconds."""

from __future__ import annotations

from builtin_interfaces.msg import Time

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import NANOSECONDS

__all__ = ['fill_stamp', 'stamp_from_message', 'stamp_to_message']


def stamp_to_message(stamp: int) -> Time:
    """Return nanoseconds as a message."""
    message = Time()
    fill_stamp(message, stamp)
    return message


def fill_stamp(message: Time, stamp: int) -> None:
    """Write nanoseconds into a time message."""
    message.sec, message.nanosec = divmod(stamp, NANOSECONDS)
