"""Stamps: builtin_interfaces/Time as integer nanoseconds."""

from __future__ import annotations

from typing import Any

from tablerunner.types import NANOSECONDS


def stamp_from_message(message: Any) -> int:
    """Return a message's time as nanoseconds."""
    return int(message.sec * NANOSECONDS + message.nanosec)
