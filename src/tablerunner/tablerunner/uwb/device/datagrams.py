"""A UDP socket that listens for datagrams."""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable

from tablerunner.uwb.device.source import Arrival, Source, SourceError

MOST_DATAGRAMS = 100
"""Of one read: a flood must not keep the reader from its other work."""

LARGEST = 65_535


class Datagrams(Source):
    """A bound UDP socket; each arrival is one datagram.

    Parameters
    ----------
    address : str
        Of the network interface to listen on; empty: all.
    port : int
        0 lets the system choose.
    clock : callable
        Returns host time [ns].
    """

    def __init__(self, address: str, port: int, clock: Callable[[], int] = time.time_ns) -> None:
        self._place = (address, port)
        self._clock = clock
        self._socket: socket.socket | None = None
        self.name = f'udp {address or "*"}:{port}'

    @property
    def port(self) -> int:
        """The port that is listened on; 0 while it is closed."""
        return 0 if self._socket is None else int(self._socket.getsockname()[1])

    def open(self) -> None:
        """Bind the socket."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.bind(self._place)
        except OSError as error:
            sock.close()
            words = os.strerror(error.errno) if error.errno else str(error)
            raise SourceError(f'{self.name} cannot be listened on: {words}') from error
        self._socket = sock

    def read(self, wait_s: float) -> list[Arrival]:
        """Return the datagrams that wait, in order."""
        sock = self._socket
        if sock is None:
            raise SourceError(f'{self.name} is not open')
        arrivals: list[Arrival] = []
        try:
            if not select.select([sock], [], [], wait_s)[0]:
                return arrivals
            while len(arrivals) < MOST_DATAGRAMS:
                data = sock.recv(LARGEST)
                arrivals.append(Arrival(self._clock(), data))
        except BlockingIOError:
            pass
        except OSError as error:
            self.close()
            raise SourceError(f'{self.name} has gone: {error}') from error
        return arrivals

    def close(self) -> None:
        """Close the socket."""
        sock, self._socket = self._socket, None
        if sock is not None:
            sock.close()
