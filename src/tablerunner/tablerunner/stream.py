"""The order of stamps in one stream: late, repeated, or started again from an earlier time."""

from __future__ import annotations

from enum import Enum

from tablerunner.types import nanoseconds

RESTART_AFTER_S = 1.0
"""Stamps this far behind the newest belong to a stream that began again (a bag restarted) ..."""

RESTART_COUNT = 3
"""... once this many came in a row, each later than the one before: one stray is no restart."""


class Order(Enum):
    """Where a stamp stands among those before it."""

    NEWEST = 'newest'
    LATE = 'stamp does not advance'
    ZERO = 'zero stamp'
    RESTARTED = 'time went back: started again'


class StampOrder:
    """Watches the stamps of one stream."""

    def __init__(self) -> None:
        self._newest = 0
        self._earlier = 0  # newest of the stamps that may begin a restarted stream
        self._count = 0

    @property
    def newest(self) -> int:
        """The newest stamp so far; 0 before the first."""
        return self._newest

    def judge(self, stamp: int) -> Order:
        """Return where the stamp stands, and remember it.

        After `Order.RESTARTED` the stamp counts as the first of a new stream: whoever holds
        anything from before must drop it.
        """
        if stamp <= 0:
            return Order.ZERO
        if stamp > self._newest:
            self._newest, self._count = stamp, 0
            return Order.NEWEST
        if stamp > self._newest - nanoseconds(RESTART_AFTER_S):
            self._count = 0
            return Order.LATE
        self._count = self._count + 1 if self._count and stamp > self._earlier else 1
        self._earlier = stamp
        if self._count < RESTART_COUNT:
            return Order.LATE
        self._newest, self._count = stamp, 0
        return Order.RESTARTED
