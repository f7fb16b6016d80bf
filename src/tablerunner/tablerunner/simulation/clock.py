"""Clock of a UWB device: a counter with its own zero and its own rate."""

from __future__ import annotations

import math

import numpy as np

TICKS_PER_SECOND = 128 * 499.2e6
"""Nominal rate of the counters (IEEE 802.15.4 HRP: 128 times the chip rate) [Hz]."""

COUNTER_BITS = 40
"""Width of the counters: they wrap every 17.2 s."""

_MASK = (1 << COUNTER_BITS) - 1


class DeviceClock:
    """A counter that starts anywhere and whose rate is off and wanders.

    The count is kept as whole ticks and a fraction and moved on from exchange to exchange, so that
    it stays exact to a fraction of a tick however long the run (a float of seconds would not).
    """

    def __init__(self, error_ppm: float, walk_ppm: float, random: np.random.Generator) -> None:
        self._ticks = int(random.integers(1 << COUNTER_BITS))
        self._fraction = float(random.random())
        self.rate_error = error_ppm * 1e-6 * float(random.standard_normal())
        self._walk = walk_ppm * 1e-6
        self._random = random
        self._now_ns: int | None = None

    @property
    def rate(self) -> float:
        """Ticks per true second, now."""
        return TICKS_PER_SECOND * (1.0 + self.rate_error)

    def advance(self, now_ns: int) -> None:
        """Move on to `now_ns`, which is the origin of `read` and `when` until the next call."""
        if self._now_ns is not None:
            elapsed_s = (now_ns - self._now_ns) * 1e-9
            moved = self._fraction + elapsed_s * self.rate
            whole = math.floor(moved)
            self._ticks += whole
            self._fraction = moved - whole
            draw = float(self._random.standard_normal())
            self.rate_error += self._walk * math.sqrt(elapsed_s) * draw
        self._now_ns = now_ns

    def read(self, offset_s: float) -> int:
        """Return the count, without wrap, `offset_s` after now."""
        return self._ticks + round(self._fraction + offset_s * self.rate)

    def when(self, ticks: int) -> float:
        """Return how long after now the clock shows `ticks` (without wrap) [s]."""
        return (ticks - self._ticks - self._fraction) / self.rate


def wrap_counter(ticks: int) -> int:
    """Return what a 40-bit register shows."""
    return ticks & _MASK
