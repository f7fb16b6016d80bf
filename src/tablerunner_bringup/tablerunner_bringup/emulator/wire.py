"""A serial port without a cable: a pseudo-terminal under a path of one's own."""

from __future__ import annotations

import contextlib
import os
import tty
from pathlib import Path
from types import TracebackType

from tablerunner.errors import ConfigError

_MOST = 4096


class Wire:
    """The device's end of a port; whoever opens `path` has the other.

    Raises
    ------
    ConfigError
        On entering: the path cannot be made, or something else is there.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._end = -1

    def __enter__(self) -> Wire:
        if self.path.exists() and not self.path.is_symlink():
            raise ConfigError('--port', str(self.path), 'a path at which nothing is')
        self._end, other = os.openpty()
        tty.setraw(self._end)
        os.set_blocking(self._end, False)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(other))
        except OSError as error:
            self.__exit__(None, None, None)
            expected = f'a path that can be made ({error.strerror})'
            raise ConfigError('--port', str(self.path), expected) from error
        finally:
            os.close(other)  # it is for whoever opens the path
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.path.is_symlink():
            self.path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            os.close(self._end)

    def write(self, data: bytes) -> None:
        """Send bytes; where nobody reads, what does not fit is lost, as on a cable."""
        if data:
            with contextlib.suppress(OSError):
                os.write(self._end, data)

    def read(self) -> bytes:
        """Return what has been sent to the device since the last call."""
        try:
            return os.read(self._end, _MOST)
        except OSError:  # nothing there, or nobody has the port open
            return b''
