"""Binary frames found by their header in a stream that may hold anything in between.

A header may come up by chance, in noise or after lost bytes, and ask for more bytes than there
will be. So what follows an unfinished frame is looked through as well: a whole frame inside it
shows that the unfinished one is none. Nothing waits for a frame that was cut off.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

from tablerunner.uwb.protocol.parser import MAX_RANGE_M, NO_FRAME, TRUNCATED, Parser


class Fault(NamedTuple):
    """Why a frame is refused, and which part of it is damaged."""

    reason: str
    part: str = ''


class FramedParser(Parser):
    """Base of the parsers of binary frames.

    A frame is at most `longest` bytes long: no more than that is ever kept. One of less than
    `telling` bytes comes up by chance, and says nothing against a frame that is waited for.
    """

    longest = 0
    telling = 0

    def __init__(self, max_range_m: float = MAX_RANGE_M) -> None:
        super().__init__(max_range_m)
        self._buffer = bytearray()

    @property
    def buffered(self) -> int:
        """Bytes that wait for the rest of their frame."""
        return len(self._buffer)

    def reset(self) -> None:
        """Forget the unfinished frame, as after a reconnection; counts stay."""
        self._buffer.clear()

    def _take(self, data: bytes) -> None:
        self._buffer += data
        buffer = bytes(self._buffer)
        begin = at = 0  # begin: what is not yet accounted for; at: where to look on
        waiting = -1  # the first header whose frame is not whole
        faults: list[tuple[int, Fault]] = []
        while True:
            start = self._find(buffer, at, at == begin)
            if start < 0:
                break
            length = self._length(buffer, start)
            if length == 0:
                at = start + 1
                continue
            if length < 0 or start + length > len(buffer):
                if waiting < 0:
                    waiting = start
                at = start + 1
                continue
            if waiting >= 0 and length < self.telling:
                at = start + 1
                continue
            fault = self._fault(buffer, start, length)
            if fault is not None:
                faults.append((start, fault))
                at = start + 1
                continue
            if waiting >= 0:
                faults.append((waiting, Fault(TRUNCATED)))
            self._account(start - begin, faults)
            self._frames += 1
            self._date(len(buffer) - start - length)
            self._decode(buffer, start, length)
            begin = at = start + length
            waiting = -1
            faults = []
        # Settled is what stands before the frame that is waited for or what may begin one.
        keep = waiting if waiting >= 0 else self._tail(buffer, begin)
        keep = max(keep, len(buffer) - self.longest)
        self._account(keep - begin, [item for item in faults if item[0] < keep])
        del self._buffer[:keep]
        if keep > begin:
            self._lost()

    def _account(self, skipped: int, faults: list[tuple[int, Fault]]) -> None:
        """Refuse what was skipped: by the faults found in it, or as bytes of no frame."""
        if faults:
            for _, fault in sorted(faults, key=lambda item: item[0]):
                self._refuse(fault.reason, fault.part)
        elif skipped > 0:
            self._refuse(NO_FRAME)
        if skipped > 0:
            self._lost()

    def _lost(self) -> None:
        """Forget what the next frame would have continued."""

    @abstractmethod
    def _find(self, buffer: bytes, at: int, first: bool) -> int:
        """Return where the next header may begin, from `at` on, or -1.

        `first`: the place `at` directly follows a frame that was understood.
        """

    @abstractmethod
    def _tail(self, buffer: bytes, begin: int) -> int:
        """Return from where on the end of the buffer may be the first bytes of a header."""

    @abstractmethod
    def _length(self, buffer: bytes, start: int) -> int:
        """Return the length of the frame that begins here; 0: none does, -1: not known yet."""

    @abstractmethod
    def _fault(self, buffer: bytes, start: int, length: int) -> Fault | None:
        """Return what is wrong with a whole frame."""

    @abstractmethod
    def _decode(self, buffer: bytes, start: int, length: int) -> None:
        """Give the records of a frame that is in order."""
