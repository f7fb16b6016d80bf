"""Where a device's bytes come from: the one face of serial ports, sockets and captures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from tablerunner.errors import TablerunnerError
from tablerunner.types import Refusal


class SourceError(TablerunnerError):
    """A source cannot be opened, or has gone; says why and, where that is known, what to do."""


class Arrival(NamedTuple):
    """Bytes of one read, or one datagram, and when they came."""

    stamp: int  # [ns]; of a capture: the time of the capture
    data: bytes
    lost: bool = False  # something is missing before it


class Source(ABC):
    """Bytes from somewhere; after an error it is closed, and may be opened again.

    Attributes
    ----------
    name : str
        What it reads, for messages: a port, an address, a file.
    """

    name = ''

    @abstractmethod
    def open(self) -> None:
        """Open it; raise `SourceError` where that is not possible now."""

    @abstractmethod
    def read(self, wait_s: float) -> list[Arrival]:
        """Return what came, waiting for it no longer than `wait_s` [s].

        Raises
        ------
        SourceError
            It has gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it, if it is open."""

    def write(self, data: bytes) -> None:
        """Send something to the device; `SourceError` where that is not possible."""
        raise SourceError(f'{self.name} cannot be written to, {len(data)} bytes are lost')

    def host_stamp(self, stamp: int) -> int:
        """Return the host time [ns] of a time of its arrivals."""
        return stamp

    def refusals(self) -> tuple[Refusal, ...]:
        """Return what of the source itself was damaged since the last call."""
        return ()

    @property
    def finished(self) -> bool:
        """Whether there is nothing more to come, ever."""
        return False
