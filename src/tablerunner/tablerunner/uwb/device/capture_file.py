"""Captures on disk: played back at the pace at which they were taken, and written.

The format is that of `tablerunner.uwb.protocol.capture`.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from tablerunner.errors import ConfigError
from tablerunner.types import NANOSECONDS, Refusal
from tablerunner.uwb.device.source import Arrival, Source, SourceError
from tablerunner.uwb.protocol import PROTOCOLS, Replay, capture_chunk, capture_header
from tablerunner.uwb.protocol.parser import TRUNCATED, Parser

BLOCK = 65_536
"""Bytes read of the file at once."""

HEAD_BLOCKS = 16
"""Blocks within which a good file has shown its first chunk: one is at most 64 KiB long."""

MOST_AT_ONCE = 200
"""Arrivals of one read."""


class _Chunks(Parser):
    """Takes the chunks of a capture instead of reading what they say."""

    def __init__(self) -> None:
        super().__init__()
        self.arrivals: list[Arrival] = []
        self._lost = False

    @property
    def buffered(self) -> int:
        return 0

    def reset(self) -> None:
        self._lost = True

    def _take(self, data: bytes) -> None:
        self.arrivals.append(Arrival(self._arrival, data, self._lost))
        self._lost = False


class CaptureFile(Source):
    """A capture, played back once.

    Parameters
    ----------
    path : str
        The file; `ConfigError` where it cannot be read or holds no capture.
    rate : float
        How many times faster than it was taken.
    keep_stamps : bool
        Whether its times are kept; else they are moved to the present.
    clock, steady, sleep : callable
        Host time [ns], steady time [s], and waiting [s].

    Attributes
    ----------
    protocol : str
        What the captured bytes speak.
    """

    def __init__(
        self,
        path: str,
        rate: float = 1.0,
        keep_stamps: bool = False,
        clock: Callable[[], int] = time.time_ns,
        steady: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        self.name = path
        self._rate = rate
        self._keep_stamps = keep_stamps
        self._clock, self._steady, self._sleep = clock, steady, sleep
        self._file: BinaryIO | None = None
        self._chunks = _Chunks()
        self._reader = Replay(self._take_protocol)
        self._waiting: deque[Arrival] = deque()
        self._refusals: list[Refusal] = []
        self._ended = self._started = False
        self._first = self._last = 0  # of what is played: its first and its newest time [ns]
        self._begun_ns, self._begun_s = 0, 0.0  # when the first was played
        self.protocol = ''
        self.protocol = self._look()

    @property
    def finished(self) -> bool:
        """Whether all of it has been played."""
        return self._ended and not self._waiting

    def open(self) -> None:
        """Begin at the beginning, now."""
        self.close()
        self._chunks.reset()
        self._chunks.arrivals.clear()
        self._reader.reset()
        self._waiting.clear()
        self._started = self._ended = False
        try:
            self._file = Path(self.name).open('rb')  # noqa: SIM115 (closed by close)
        except OSError as error:
            raise SourceError(f'{self.name} cannot be read: {error.strerror}') from error

    def read(self, wait_s: float) -> list[Arrival]:
        """Return the chunks that are due."""
        self._fill()
        if not self._waiting:
            return []
        if not self._started or self._waiting[0].stamp < self._last:  # another capture behind it
            self._started = True
            self._first = self._last = self._waiting[0].stamp
            self._begun_ns, self._begun_s = self._clock(), self._steady()
        left_s = self._due_s(self._waiting[0].stamp) - self._steady()
        if left_s > 0.0:
            self._sleep(min(left_s, wait_s))
        now = self._steady()
        due: list[Arrival] = []
        while self._waiting and len(due) < MOST_AT_ONCE:
            arrival = self._waiting[0]
            if arrival.stamp < self._last or self._due_s(arrival.stamp) > now:
                break
            self._last = arrival.stamp
            due.append(self._waiting.popleft())
        return due

    def host_stamp(self, stamp: int) -> int:
        """Return the time as captured, or moved to when it is played."""
        if self._keep_stamps:
            return stamp
        return self._begun_ns + round((stamp - self._first) / self._rate)

    def refusals(self) -> tuple[Refusal, ...]:
        """Return what of the file was damaged."""
        found, self._refusals = tuple(self._refusals), []
        return found

    def close(self) -> None:
        """Close the file."""
        file, self._file = self._file, None
        if file is not None:
            file.close()

    def _take_protocol(self, name: str) -> Parser:
        if name not in PROTOCOLS or self.protocol not in ('', name):
            raise KeyError(name)
        return self._chunks

    def _due_s(self, stamp: int) -> float:
        return self._begun_s + (stamp - self._first) / (self._rate * NANOSECONDS)

    def _fill(self) -> None:
        """Read on until there is a chunk, or the end."""
        file = self._file
        while file is not None and not self._waiting and not self._ended:
            try:
                block = file.read(BLOCK)
            except OSError as error:
                self.close()
                raise SourceError(f'{self.name} cannot be read: {error.strerror}') from error
            self._refusals += self._reader.feed(block, 0).refusals
            self._waiting.extend(self._chunks.arrivals)
            self._chunks.arrivals.clear()
            if not block:
                self._ended = True
                if self._reader.buffered:
                    self._refusals.append(Refusal(self._last, 'replay', 'end', TRUNCATED))

    def _look(self) -> str:
        """Return the protocol of the file's first header; ConfigError where there is none."""
        expected = f'a capture of one of {", ".join(sorted(PROTOCOLS))}'
        try:
            with Path(self.name).open('rb') as file:
                for _ in range(HEAD_BLOCKS):
                    block = file.read(BLOCK)
                    self._reader.feed(block, 0)
                    if self._chunks.arrivals or not block:
                        break
        except OSError as error:
            raise ConfigError(
                'replay.file', self.name, f'{expected} that can be read: {error.strerror}'
            ) from error
        protocol = self._reader.protocol
        if not protocol or protocol not in PROTOCOLS:
            found = f'it is one of {protocol!r}' if protocol else 'no good header begins it'
            raise ConfigError('replay.file', self.name, f'{expected}; {found}')
        if not self._chunks.arrivals:
            raise ConfigError('replay.file', self.name, f'{expected}; nothing in it is whole')
        return protocol


class CaptureWriter:
    """Writes what arrives into a capture; a file that is there already is continued.

    Parameters
    ----------
    path : str
        `ConfigError` where it cannot be written.
    protocol : str
        What the bytes speak.
    stamp : int
        When it is begun [ns].

    Attributes
    ----------
    error : str
        Why nothing is written any more; empty while all is well.
    """

    def __init__(self, path: str, protocol: str, stamp: int) -> None:
        self.error = ''
        try:
            self._file: BinaryIO | None = Path(path).open('ab', 0)  # noqa: SIM115 (by close)
        except OSError as error:
            raise ConfigError(
                'capture_file', path, f'a file that can be written: {error.strerror}'
            ) from error
        self._put(capture_header(protocol, stamp))

    def add(self, arrival: Arrival) -> None:
        """Write one arrival; after an error (a full disk) nothing more."""
        self._put(capture_chunk(arrival.stamp, arrival.data))

    def close(self) -> None:
        """Close the file."""
        file, self._file = self._file, None
        if file is not None:
            file.close()

    def _put(self, data: bytes) -> None:
        if self._file is None:
            return
        try:
            if self._file.write(data) != len(data):
                raise OSError(0, 'it was written in part only')
        except OSError as error:
            self.error = error.strerror or str(error)
            self.close()
