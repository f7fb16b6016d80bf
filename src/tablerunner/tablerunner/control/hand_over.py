"""The stay at a stop: for its time, and until somebody confirms the hand-over or time is up."""

from __future__ import annotations

from tablerunner.control.destination import Destination, MissionState


class HandOver:
    """Counts the time at one stop; pauses are not counted.

    Parameters
    ----------
    stop : Destination
    """

    def __init__(self, stop: Destination) -> None:
        self._stop = stop
        self._stood_s = 0.0
        self._confirmed = False

    @property
    def wants_confirmation(self) -> bool:
        """Whether one is wanted here and has not been given."""
        return self._stop.confirm_s > 0.0 and not self._confirmed

    @property
    def state(self) -> MissionState:
        """What the robot is waiting for."""
        return MissionState.HANDING_OVER if self.wants_confirmation else MissionState.WAITING

    def confirm(self) -> None:
        """Take note that the hand-over is done."""
        self._confirmed = True

    def step(self, elapsed_s: float) -> bool:
        """Return whether the robot is to leave, `elapsed_s` after the last step."""
        self._stood_s += elapsed_s
        enough = self._stop.confirm_s if self.wants_confirmation else 0.0
        return self._stood_s >= max(self._stop.wait_s, enough)
