"""A container for captured bytes with the times at which they came, and its replay.

A capture is a header and any number of chunks, each with a checksum, so that a file that was cut
off or damaged is noticed and read on behind the damage. Layout: docs/protocols.md. Nothing here
opens a file: bytes in, bytes out.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple
from zlib import crc32

from tablerunner.types import Refusal
from tablerunner.uwb.protocol.framed import Fault, FramedParser
from tablerunner.uwb.protocol.parser import Parser
from tablerunner.uwb.protocol.record import Record

LONGEST_CHUNK = 65_535
"""Bytes of one chunk; a writer splits longer reads of a stream."""

_MARK = b'\xf5TRC'
_HEAD = struct.Struct('<4sBqHI')  # mark, kind, stamp [ns], bytes that follow, their CRC-32
_BEGIN, _DATA = 0, 1
_LONGEST_NAME = 64


class Chunk(NamedTuple):
    """Bytes that came at once, and when [ns]."""

    stamp: int
    data: bytes


def capture_header(protocol: str, stamp: int) -> bytes:
    """Return what a capture begins with.

    Parameters
    ----------
    protocol : str
        Name of the protocol that its bytes speak, of `PROTOCOLS`.
    stamp : int
        When the capture was begun [ns].
    """
    name = protocol.encode()
    if not 0 < len(name) <= _LONGEST_NAME:
        raise ValueError(f'a protocol has a name of 1 to {_LONGEST_NAME} bytes, not {protocol!r}')
    return _packed(_BEGIN, stamp, name)


def capture_chunk(stamp: int, data: bytes) -> bytes:
    """Return the chunk, or chunks, of bytes that came at `stamp` [ns]."""
    parts = range(0, max(len(data), 1), LONGEST_CHUNK)
    return b''.join(_packed(_DATA, stamp, data[at : at + LONGEST_CHUNK]) for at in parts)


def _packed(kind: int, stamp: int, data: bytes) -> bytes:
    return _HEAD.pack(_MARK, kind, stamp, len(data), _crc(kind, stamp, data)) + data


def _crc(kind: int, stamp: int, data: bytes) -> int:
    return crc32(data, crc32(struct.pack('<BqH', kind, stamp, len(data))))


class Replay(FramedParser):
    """Reads a capture and what the captured bytes say, with the times of the capture.

    The stamps given to `feed` do not matter. Before the header came, or where it names a protocol
    that `open_protocol` does not know, chunks are refused.

    Parameters
    ----------
    open_protocol : callable
        Makes the parser of a protocol by its name; raises `KeyError` for a name it does not know.

    Attributes
    ----------
    protocol : str
        What the capture's header names; empty before it was read.
    parser : Parser or None
        What reads the captured bytes.
    """

    source = 'replay'
    longest = _HEAD.size + LONGEST_CHUNK

    def __init__(self, open_protocol: Callable[[str], Parser]) -> None:
        super().__init__()
        self._open_protocol = open_protocol
        self.protocol = ''
        self.parser: Parser | None = None

    def reset(self) -> None:
        """Begin anew, as with another capture; counts stay."""
        super().reset()
        self.protocol, self.parser = '', None

    def _find(self, buffer: bytes, at: int, first: bool) -> int:  # noqa: ARG002  no continuation
        return buffer.find(_MARK, at)

    def _tail(self, buffer: bytes, begin: int) -> int:
        for length in range(min(len(_MARK) - 1, len(buffer) - begin), 0, -1):
            if buffer.endswith(_MARK[:length]):
                return len(buffer) - length
        return len(buffer)

    def _length(self, buffer: bytes, start: int) -> int:
        if len(buffer) - start < _HEAD.size:
            return -1
        _, kind, _, length, _ = _HEAD.unpack_from(buffer, start)
        return _HEAD.size + length if kind in (_BEGIN, _DATA) else 0

    def _fault(self, buffer: bytes, start: int, length: int) -> Fault | None:
        _, kind, stamp, _, crc = _HEAD.unpack_from(buffer, start)
        if _crc(kind, stamp, buffer[start + _HEAD.size : start + length]) != crc:
            return Fault('checksum does not agree', 'chunk')
        return None

    def _lost(self) -> None:
        # What was in the lost chunk is missing in the middle of the captured stream.
        if self.parser is not None:
            self.parser.reset()

    def _decode(self, buffer: bytes, start: int, length: int) -> None:
        _, kind, stamp, _, _ = _HEAD.unpack_from(buffer, start)
        data = buffer[start + _HEAD.size : start + length]
        self._stamp = stamp
        if kind == _BEGIN:
            self._begin(data)
        elif self.parser is None:
            self._refuse('no protocol is known to read this', self.protocol)
        else:
            parsed = self.parser.feed(data, stamp)
            self._pass_on(parsed.records, parsed.refusals)

    def _begin(self, name: bytes) -> None:
        self.protocol = name.decode('utf-8', 'replace')
        try:
            self.parser = self._open_protocol(self.protocol)
        except KeyError:
            self.parser = None
            self._refuse('unknown protocol', self.protocol)

    def _pass_on(self, records: tuple[Record, ...], refusals: tuple[Refusal, ...]) -> None:
        # They are counted by their own parser; counting them here again says where they came up.
        self._records += records
        self._refusals += refusals
        self._counts.update(refusal.reason for refusal in refusals)
