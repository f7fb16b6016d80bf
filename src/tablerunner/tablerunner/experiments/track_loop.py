"""The whole robot along a given track: no mission, no planner's choice of the way."""

from __future__ import annotations

from collections.abc import Iterator

from tablerunner.control import MissionStatus, Path
from tablerunner.experiments.closed_loop import ClosedLoop, LoopSettings, LoopStep
from tablerunner.scenario import Scenario
from tablerunner.types import Velocity, nanoseconds


class TrackLoop(ClosedLoop):
    """A simulated robot that keeps to a track on what its localiser believes.

    Parameters
    ----------
    scenario, seed, settings
        As `ClosedLoop`.
    """

    def __init__(self, scenario: Scenario, seed: int, settings: LoopSettings) -> None:
        super().__init__(scenario, seed, settings)
        self._tracking = False
        self.arrived = False

    def keep_to(self, path: Path, longest_s: float) -> Iterator[LoopStep]:
        """Yield each control step along the track until its end, or until time is up."""
        until = self.now + nanoseconds(longest_s)
        self.controller.follow(path)
        self._tracking = True
        while not self.arrived and self.now < until:
            yield self.step()

    def _control(self) -> MissionStatus:
        velocity, sample = Velocity(), self._sample
        if self._tracking and sample is not None:
            self.controller.hear(self._ring.readings(self.now))
            drive = self.controller.step(sample.pose, 1.0 / self.settings.control_rate)
            velocity, self.arrived = drive.velocity, drive.arrived
        self._command, self._command_stamp = velocity, self.now
        self._send(self._decide())
        return self.mission.status
