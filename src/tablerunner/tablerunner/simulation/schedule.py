"""When a sensor is due."""

from __future__ import annotations

from tablerunner.types import nanoseconds


class Schedule:
    """Fires once per period, on the first step at or after each due time.

    A period that is no multiple of the step gives stamps that jitter by less than a step and keep
    the rate on average.
    """

    def __init__(self, period_s: float, start_ns: int, phase_s: float = 0.0) -> None:
        self._period_s = period_s
        self._start_ns = start_ns + nanoseconds(phase_s)
        self._count = 1
        self._next_ns = self._start_ns + nanoseconds(period_s)

    def is_due(self, now_ns: int) -> bool:
        """Return whether it fires now; each due time is answered once."""
        if now_ns < self._next_ns:
            return False
        self._count += 1
        self._next_ns = self._start_ns + nanoseconds(self._count * self._period_s)
        return True
