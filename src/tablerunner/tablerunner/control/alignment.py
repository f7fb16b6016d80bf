"""Finding the heading by driving: ranges alone tell where the robot is, not where it looks."""

from __future__ import annotations

from tablerunner.types import Velocity, nanoseconds


class AlignmentDrive:
    """A slow, gentle arc; where something is in the way, a turn on the spot before the next try.

    Parameters
    ----------
    speed : float
        [m/s]
    turn_rate : float
        Of the arc [rad/s].
    """

    TURN_RATE_ON_SPOT = 0.5  # [rad/s]
    TURN_S = 1.6

    def __init__(self, speed: float, turn_rate: float) -> None:
        self._arc = Velocity(speed, turn_rate)
        self._turn_until = 0

    def step(self, stamp: int, blocked: bool) -> Velocity:
        """Return what to drive; the safety stop has the last word."""
        if blocked and stamp >= self._turn_until:
            self._turn_until = stamp + nanoseconds(self.TURN_S)
        if stamp < self._turn_until:
            return Velocity(0.0, self.TURN_RATE_ON_SPOT)
        return self._arc
