"""Progress on stderr: a live line in a terminal, plain lines now and then elsewhere."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.status import Status

_PLAIN_INTERVAL_S = 5.0
_LIVE_INTERVAL_S = 0.1


class Progress:
    """Says what happens (`say`) and what is the case (`show`)."""

    def __init__(self, console: Console | None = None, quiet: bool = False) -> None:
        self._console = console or Console(stderr=True, highlight=False, quiet=quiet)
        self._live: Status | None = None
        self._shown_at = 0.0

    def __enter__(self) -> Progress:
        """Begin the live line, where there is a terminal."""
        if self._console.is_terminal:
            self._live = self._console.status('', spinner='dots')
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the live line."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def say(self, text: str, style: str = '') -> None:
        """Print a line that stays."""
        self._console.print(text, style=style or None, markup=False, soft_wrap=True)

    def show(self, text: str) -> None:
        """Replace the live line; without a terminal, print it at most every five seconds."""
        now = time.monotonic()
        if now - self._shown_at < (_PLAIN_INTERVAL_S if self._live is None else _LIVE_INTERVAL_S):
            return
        self._shown_at = now
        if self._live is None:
            self.say(text)
        else:
            self._live.update(escape(text))
