"""Looking around: a blocked robot turns a little to both sides, so that its sensors sweep.

Between the cones of the ultrasonic sensors lies what they do not hear. What was heard there last
is remembered (`tablerunner.control.echoes`) until a sensor looks at the place again.
"""

from __future__ import annotations

from tablerunner.types import NANOSECONDS, Velocity, nanoseconds, seconds

_RATE = 0.6  # [rad/s]
_SWING_S = 1.0  # to one side; the cones are 40 to 50 degrees apart


class LookAround:
    """Swings to the left, to the right and back, and not again for a while.

    Parameters
    ----------
    pause_s : float
        Time from the beginning of one look to the next [s].
    """

    def __init__(self, pause_s: float) -> None:
        self._pause_ns = nanoseconds(pause_s)
        self._begun: int | None = None

    def step(self, stamp: int, wanted: bool) -> Velocity | None:
        """Return what to drive while looking, None otherwise; `wanted` starts a look."""
        rested = self._begun is None or stamp - self._begun >= self._pause_ns
        if wanted and rested:
            self._begun = stamp
        if self._begun is None or stamp - self._begun >= 4 * _SWING_S * NANOSECONDS:
            return None
        swing = seconds(stamp - self._begun) / _SWING_S
        return Velocity(0.0, _RATE if swing < 1.0 or swing >= 3.0 else -_RATE)
