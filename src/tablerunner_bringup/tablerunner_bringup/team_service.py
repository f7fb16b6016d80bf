"""Deliveries by several robots at once, each in its namespace."""

from __future__ import annotations

from collections.abc import Sequence

from tablerunner.cli.console import Progress
from tablerunner_bringup.delivery import Delivery, activity
from tablerunner_bringup.session import Session


class TeamService:
    """Each robot's share of the stops: the first stop is the first robot's, and so on in turn.

    A robot that gets none stands where it is.

    Parameters
    ----------
    session : Session
    stops : sequence of str
    wait_s : float
    return_home : bool
        Whether each robot drives back to where it started.
    progress : Progress
    """

    def __init__(
        self,
        session: Session,
        stops: Sequence[str],
        wait_s: float,
        return_home: bool,
        progress: Progress,
    ) -> None:
        self._session = session
        self._progress = progress
        names = list(session.robots)
        self.shares = {
            name: tuple(stops[index :: len(names)])
            for index, name in enumerate(names)
            if stops[index :: len(names)]
        }
        self._deliveries = {
            name: Delivery(session.node('tablerunner_delivery', name), share, wait_s, return_home)
            for name, share in self.shares.items()
        }
        self._said: dict[str, tuple[str, str]] = {}
        self._told: set[str] = set()
        self._touches = dict.fromkeys(names, 0)

    @property
    def is_ready(self) -> bool:
        """Whether every robot that is needed can be sent."""
        # Each is asked, and so moved on, every time.
        ready = [delivery.is_ready for delivery in self._deliveries.values()]
        return all(ready)

    @property
    def success(self) -> bool:
        """Whether every delivery ended well."""
        outcomes = [delivery.outcome for delivery in self._deliveries.values()]
        return all(outcome is not None and outcome.success for outcome in outcomes)

    def send(self) -> None:
        """Send all at once."""
        for name, delivery in self._deliveries.items():
            delivery.send()
            self._progress.say(f'{name}: delivery to ' + ', '.join(self.shares[name]))

    def is_done(self) -> bool:
        """Handle and tell what has come; return whether all deliveries ended."""
        for name, delivery in self._deliveries.items():
            delivery.spin(0.0)
            self._tell(name, delivery)
        for name, monitor in self._session.robots.items():
            for touch in monitor.touches[self._touches[name] :]:
                self._progress.say(f'{name}: {touch.words}', 'red')
            self._touches[name] = len(monitor.touches)
        return len(self._told) == len(self._deliveries)

    def _tell(self, name: str, delivery: Delivery) -> None:
        feedback, outcome = delivery.feedback, delivery.outcome
        if feedback is not None and (feedback.state, feedback.stop) != self._said.get(name):
            self._said[name] = (feedback.state, feedback.stop)
            self._progress.say(f'{name}: {activity(feedback)}')
        if outcome is not None and name not in self._told:
            self._told.add(name)
            for stop, reason in outcome.missed:
                self._progress.say(f'{name}: {stop} was missed: {reason}', 'red')
            colour = 'green' if outcome.success else 'red'
            self._progress.say(f'{name}: {outcome.message}', colour)

    def cancel(self) -> None:
        """Ask all robots to give up."""
        for delivery in self._deliveries.values():
            delivery.cancel()

    def close(self) -> None:
        """Let the clients go."""
        for delivery in self._deliveries.values():
            delivery.close()
