"""Steps on the terminal: which of how many, what it does, how long it took."""

from __future__ import annotations

import os
import sys
import time
from typing import TextIO

# Where nobody watches, a line now and then is enough to see that it is alive.
HEARTBEAT = 20.0


class Progress:
    """Print a line for each step; on a terminal the running step's is kept up to date."""

    def __init__(self, total: int, stream: TextIO = sys.stderr) -> None:
        self._total = total
        self._stream = stream
        self._live = stream.isatty() and os.environ.get('TERM', 'dumb') != 'dumb'
        self._number = 0
        self._title = ''
        self._detail = ''
        self._started = 0.0
        self._told = 0.0

    def start(self, title: str) -> None:
        """Begin the next step."""
        self._number += 1
        self._title = title
        self._detail = ''
        self._started = self._told = time.monotonic()
        if not self._live:
            self._say(f'[{self._number}/{self._total}] {title} ...\n')
        else:
            self.tell()

    def tell(self, detail: str = '') -> None:
        """Say how far the running step is, the same as before if nothing is given.

        Call it as often as you like, to keep the clock going.
        """
        self._detail = detail = detail or self._detail
        now = time.monotonic()
        seconds = f'{now - self._started:.0f} s'
        words = f'{detail}, {seconds}' if detail else seconds
        if self._live:
            line = f'[{self._number}/{self._total}] {self._title} ... {words}'
            width = _width(self._stream)
            self._say('\r\x1b[2K' + line[: width - 1])
        elif now - self._told >= HEARTBEAT:
            self._told = now
            self._say(f'      {words}\n')

    def done(self) -> None:
        """End the running step."""
        seconds = time.monotonic() - self._started
        if self._live:
            line = f'[{self._number}/{self._total}] {self._title}: {seconds:.0f} s\n'
            self._say('\r\x1b[2K' + line)
        else:
            self._say(f'      done in {seconds:.0f} s\n')

    def failed(self) -> None:
        """Leave the line of the running step, if one is open, so that an error can follow."""
        if self._live and self._number:
            self._say('\n')

    def _say(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def _width(stream: TextIO) -> int:
    try:
        return os.get_terminal_size(stream.fileno()).columns or 80
    except (OSError, ValueError):
        return 80
