"""The stops of a mission, and what became of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from tablerunner.control.destination import Destination
from tablerunner.control.planner import Planner
from tablerunner.errors import MissionError, PlanningError


@dataclass(frozen=True, slots=True)
class Tour:
    """Stops in their order, home after them if it is asked for, and how far the robot has come.

    Attributes
    ----------
    stops : tuple of Destination
    home : Destination or None
        Where the tour ends; None: at the last stop.
    index : int
        Of the stop that is next or at which the robot stands; the number of stops: home.
    reached : tuple of str
    missed : tuple of (str, str)
        Names of stops and why.
    unconfirmed : tuple of str
        Stops that were reached and where nobody confirmed in time.
    """

    stops: tuple[Destination, ...]
    home: Destination | None = None
    index: int = 0
    reached: tuple[str, ...] = ()
    missed: tuple[tuple[str, str], ...] = ()
    unconfirmed: tuple[str, ...] = ()

    @property
    def legs(self) -> tuple[Destination, ...]:
        """The stops, and home."""
        return self.stops if self.home is None else (*self.stops, self.home)

    @property
    def goal(self) -> Destination | None:
        """The stop that is next; None: the tour is over."""
        return self.legs[self.index] if self.index < len(self.legs) else None

    @property
    def is_returning(self) -> bool:
        """Whether all that is left is the way home."""
        return self.index >= len(self.stops)

    @property
    def is_standing(self) -> bool:
        """Whether the robot has arrived at a stop and not left it."""
        return len(self.reached) + len(self.missed) > self.index

    @property
    def ends_home(self) -> bool:
        """Whether the tour is over and the robot came home."""
        home = self.home
        return self.goal is None and home is not None and self.reached[-1:] == (home.name,)

    @property
    def is_success(self) -> bool:
        """Whether nothing was missed and every confirmation that was wanted was given."""
        return not (self.missed or self.unconfirmed)

    def arrive(self) -> Tour:
        """Return the tour of a robot that stands at its stop now."""
        return replace(self, reached=(*self.reached, self._name))

    def leave(self, confirmed: bool = True) -> Tour:
        """Return the tour of a robot that leaves the stop it stands at."""
        names = self.unconfirmed if confirmed else (*self.unconfirmed, self._name)
        return replace(self, index=self.index + 1, unconfirmed=names)

    def miss(self, reason: str) -> Tour:
        """Return the tour of a robot that gives its next stop up."""
        missed = (*self.missed, (self._name, reason))
        return replace(self, index=self.index + 1, missed=missed)

    def abandon(self, reason: str) -> Tour:
        """Return the tour with all that is left missed for one reason."""
        lost = tuple((stop.name, reason) for stop in self.legs[self.index :])
        return replace(self, index=len(self.legs), missed=(*self.missed, *lost))

    @property
    def message(self) -> str:
        """The outcome in one sentence."""
        words = [f'{len(self.reached)} of {len(self.legs)} stops reached']
        if self.missed:
            words.append('missed ' + '; '.join(f'{name}: {why}' for name, why in self.missed))
        if self.unconfirmed:
            words.append('not confirmed: ' + ', '.join(self.unconfirmed))
        return '; '.join(words)

    @property
    def _name(self) -> str:
        goal = self.goal
        if goal is None:
            raise ValueError('the tour is over')
        return goal.name


def check_stops(tour: Tour, planner: Planner) -> None:
    """Look whether a robot can go to what is left of a tour.

    Raises
    ------
    MissionError
        Nothing is left, or a time is not one.
    PlanningError
        The robot cannot stand at one of the stops; which and why.
    """
    if tour.goal is None:
        raise MissionError('a delivery needs at least one stop')
    for stop in tour.stops[tour.index :]:
        if not (math.isfinite(stop.wait_s) and stop.wait_s >= 0.0):
            raise MissionError(f'{stop.name}: the wait must be at least 0 s')
        if not (math.isfinite(stop.confirm_s) and stop.confirm_s >= 0.0):
            raise MissionError(f'{stop.name}: the time to confirm must be at least 0 s')
        try:
            planner.check_goal(stop.pose)
        except PlanningError as error:
            raise PlanningError(f'{stop.name}: {error}') from None
