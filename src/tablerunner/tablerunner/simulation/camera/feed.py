"""The camera's pictures as they arrive: exposed at its rate, published a while later."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from tablerunner.scenario import Scenario
from tablerunner.simulation.camera.view import CeilingView, RobotView
from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.truth import PersonState
from tablerunner.types import ImageSample, nanoseconds, seconds


class CameraFeed:
    """Exposes pictures when they are due and gives them out after their delay.

    Parameters
    ----------
    scenario : Scenario
        With a camera.
    seed : int
    start_ns : int
        When it begins.
    """

    def __init__(self, scenario: Scenario, seed: int, start_ns: int) -> None:
        self.view = CeilingView(scenario, seed)
        camera = self.view.camera
        self._due = Schedule(1.0 / camera.rate, start_ns)
        self._delay_ns = nanoseconds(camera.delay)
        self._waiting: deque[ImageSample] = deque()

    def step(
        self,
        now: int,
        robots: Callable[[], Sequence[RobotView]],
        people: Sequence[PersonState],
    ) -> ImageSample | None:
        """Return the picture that arrives now, if one does.

        Parameters
        ----------
        now : int
            Stamp [ns].
        robots : callable
            Returns all robots as they are now; asked only where a picture is exposed.
        people : sequence of PersonState
        """
        if self._due.is_due(now):
            pixels = self.view.draw(seconds(now), robots(), people)
            self._waiting.append(ImageSample(now, pixels))
        if self._waiting and now >= self._waiting[0].stamp + self._delay_ns:
            return self._waiting.popleft()
        return None
