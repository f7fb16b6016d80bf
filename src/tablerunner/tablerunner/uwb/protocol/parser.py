"""The one face of all protocols: bytes in, records and refusals out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping

from tablerunner.types import Refusal
from tablerunner.uwb.protocol.record import DeviceRange, Parsed, Record

NO_FRAME = 'bytes that are no frame'
TRUNCATED = 'truncated frame'
NOT_POSITIVE = 'range is not positive'
TOO_LONG = 'range beyond max_range'

MAX_RANGE_M = 300.0
"""What is refused as too long where nothing else is asked for [m]."""


class Parser(ABC):
    """Reads one protocol as its bytes come, in pieces of any size.

    Parameters
    ----------
    max_range_m : float
        Ranges beyond this are refused [m].

    Attributes
    ----------
    source : str
        Name of the protocol, the `source` of its refusals.
    tick_ns : float
        One tick of the device's time [ns]; 0 where the protocol carries none.
    counter_bits : int
        Width of the device's counter.
    byte_ns : float
        What the line takes for a byte [ns], where it is known. A frame with others behind it in
        one read has waited for so many of their bytes at least, and is dated back by that; no
        two frames have one stamp then.
    """

    source = ''
    tick_ns = 0.0
    counter_bits = 0

    def __init__(self, max_range_m: float = MAX_RANGE_M) -> None:
        self._max_range_m = max_range_m
        self._records: list[Record] = []
        self._refusals: list[Refusal] = []
        self._counts: Counter[str] = Counter()
        self._frames = 0
        self.byte_ns = 0.0
        self._stamp = self._arrival = self._last = 0

    @property
    def counts(self) -> Mapping[str, int]:
        """How often each reason for a refusal came up."""
        return dict(self._counts)

    @property
    def frames(self) -> int:
        """Frames that were understood."""
        return self._frames

    @property
    @abstractmethod
    def buffered(self) -> int:
        """Bytes that wait for the rest of their frame."""

    def feed(self, data: bytes, stamp: int) -> Parsed:
        """Take what arrived at `stamp` [ns], and return what became whole by it."""
        self._stamp = self._arrival = stamp
        self._take(data)
        parsed = Parsed(tuple(self._records), tuple(self._refusals))
        self._records.clear()
        self._refusals.clear()
        return parsed

    @abstractmethod
    def reset(self) -> None:
        """Forget the unfinished frame, as after a reconnection; counts stay."""

    @abstractmethod
    def _take(self, data: bytes) -> None:
        """Do the protocol's own work, through `_give` and `_refuse`."""

    def _date(self, behind: int) -> None:
        """Date the frame that is decoded next, behind whose end so many bytes came already."""
        stamp = self._arrival - round(behind * self.byte_ns)
        self._stamp = self._last = min(max(stamp, self._last + 1), self._arrival)

    def _give(self, record: Record) -> None:
        """Hand out a record; a range that cannot be is refused instead."""
        if isinstance(record, DeviceRange):
            if not record.range_m > 0.0:
                self._refuse(NOT_POSITIVE, record.anchor)
                return
            if record.range_m > self._max_range_m:
                self._refuse(TOO_LONG, record.anchor)
                return
        self._records.append(record)

    def _refuse(self, reason: str, key: str = '') -> None:
        self._counts[reason] += 1
        self._refusals.append(Refusal(self._stamp, self.source, key, reason))
