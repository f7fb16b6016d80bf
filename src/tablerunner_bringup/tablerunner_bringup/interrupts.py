"""Ctrl-C, SIGTERM and a closed terminal as a question that a loop asks, not as an exception."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupts:
    """Counts the requests to end; restores the old handlers on leaving (main thread only)."""

    def __init__(self) -> None:
        self._count = 0
        self._first: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        for number in _SIGNALS:
            self._before[number] = signal.signal(number, self._receive)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            # None: installed by something that is not Python; it cannot be given back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def _receive(self, number: int, _frame: FrameType | None) -> None:
        self._count += 1
        if self._first is None:
            self._first = number

    @property
    def asked(self) -> bool:
        """Whether the run was asked to end."""
        return self._count > 0

    @property
    def insisted(self) -> bool:
        """Whether it was asked a second time, which means: at once."""
        return self._count > 1

    @property
    def name(self) -> str:
        """Name of the first signal; empty while there was none."""
        return '' if self._first is None else signal.Signals(self._first).name
