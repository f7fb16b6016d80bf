"""A serial port by pyserial, opened for this program alone."""

from __future__ import annotations

import errno
import os
import select
import time
from collections.abc import Callable

import serial

from tablerunner.uwb.device.source import Arrival, Source, SourceError

MOST_BYTES = 4096
"""Of one read: what a port's buffer holds."""

WRITE_LIMIT_S = 1.0

_WORDS = {
    errno.ENOENT: 'does not exist: is the device plugged in?',
    errno.ENODEV: 'does not exist: is the device plugged in?',
    errno.ENXIO: 'does not exist: is the device plugged in?',
    errno.EACCES: 'no permission: add the user to the group dialout, or install a udev rule',
    errno.EPERM: 'no permission: add the user to the group dialout, or install a udev rule',
    errno.EBUSY: 'is used by another program',
    errno.EAGAIN: 'is used by another program',
    errno.ENOTTY: 'is no serial port',
    errno.EISDIR: 'is no serial port',
    errno.EINVAL: 'does not know this baud rate',
}


class SerialPort(Source):
    """A serial port, 8 data bits, no parity, one stop bit, no flow control.

    It is locked: of two programs that read one port, each would get half of the bytes.

    Parameters
    ----------
    path : str
        As ``/dev/ttyACM0``.
    baud : int
        Bits a second.
    clock : callable
        Returns host time [ns].
    """

    def __init__(self, path: str, baud: int, clock: Callable[[], int] = time.time_ns) -> None:
        self.name = path
        self._baud = baud
        self._clock = clock
        self._port: serial.Serial | None = None

    def open(self) -> None:
        """Open the port.

        What waits in its buffer is forgotten (pyserial does so): nobody knows when that came.
        """
        try:
            self._port = serial.Serial(
                self.name, self._baud, timeout=0, write_timeout=WRITE_LIMIT_S, exclusive=True
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            self.close()
            raise SourceError(f'{self.name} {_reason(error)}') from error

    def read(self, wait_s: float) -> list[Arrival]:
        """Return what came as one piece."""
        port = self._opened()
        try:
            if not select.select([port.fileno()], [], [], wait_s)[0]:
                return []
            stamp = self._clock()
            # Not by pyserial, which waits for the port a second time.
            data = os.read(port.fileno(), MOST_BYTES)
        except BlockingIOError:
            return []
        except (OSError, TypeError, ValueError) as error:
            self.close()
            raise SourceError(f'{self.name} has gone: {_plain(error)}') from error
        if not data:  # ready, and nothing there
            self.close()
            raise SourceError(f'{self.name} has gone')
        return [Arrival(stamp, data)]

    def write(self, data: bytes) -> None:
        """Send bytes; a port that takes none for a second counts as gone."""
        port = self._opened()
        try:
            port.write(data)
        except (OSError, TypeError, ValueError) as error:
            self.close()
            raise SourceError(f'{self.name} takes nothing: {_plain(error)}') from error

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:
                pass  # it has been unplugged

    def _opened(self) -> serial.Serial:
        if self._port is None:
            raise SourceError(f'{self.name} is not open')
        return self._port


def _reason(error: Exception) -> str:
    number = _number(error)
    if number in _WORDS:
        return _WORDS[number]
    return f'cannot be opened: {_plain(error)}'


def _number(error: BaseException | None) -> int:
    """Return the error number; pyserial hides some in what it raises instead."""
    while error is not None:
        number = getattr(error, 'errno', None) or (error.args[0] if error.args else None)
        if isinstance(number, int):
            return number
        error = error.__cause__ or error.__context__
    return 0


def _plain(error: Exception) -> str:
    number = _number(error)
    return os.strerror(number) if number else ' '.join(str(error).split())
