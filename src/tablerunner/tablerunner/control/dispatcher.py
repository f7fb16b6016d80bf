"""Which delivery comes next: one after the other, home when that is due, none on a low battery.

Holds the mission and the queue. Deterministic; stamps come in with the situation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from tablerunner.control.battery import Battery
from tablerunner.control.delivery_queue import Delivery, DeliveryQueue
from tablerunner.control.destination import Destination, MissionState, MissionStatus, Situation
from tablerunner.control.mission import Mission
from tablerunner.control.tour import Tour
from tablerunner.errors import MissionError, PlanningError
from tablerunner.types import Velocity

Save = Callable[[DeliveryQueue], None]


@dataclass(frozen=True, slots=True)
class Ended:
    """A delivery that is over.

    Attributes
    ----------
    id : str
    state : MissionState
        Done, failed or cancelled.
    tour : Tour
        What became of its stops.
    """

    id: str
    state: MissionState
    tour: Tour


@dataclass(frozen=True, slots=True)
class DispatchStep:
    """One step.

    Attributes
    ----------
    velocity : Velocity
        What to drive now.
    status : MissionStatus
        Of what is under way.
    ended : tuple of Ended
        Deliveries that are over since the last step.
    events : tuple of str
        What happened, in words.
    """

    velocity: Velocity
    status: MissionStatus
    ended: tuple[Ended, ...]
    events: tuple[str, ...]


class Dispatcher:
    """Serves deliveries in their order, and single goals while there are none.

    Parameters
    ----------
    mission : Mission
    battery : Battery
    limit : int
        Most deliveries that are under way or wait.
    queue : DeliveryQueue
        To begin with.
    save : callable, optional
        Keeps a queue; raises MissionError where it cannot.
    """

    def __init__(
        self,
        mission: Mission,
        battery: Battery,
        limit: int = 20,
        queue: DeliveryQueue | None = None,
        save: Save | None = None,
    ) -> None:
        self.mission = mission
        self.battery = battery
        self.limit = limit
        self.fault = ''
        self._queue = DeliveryQueue() if queue is None else queue
        self._save = save
        self._current = ''  # id of the delivery under way
        self._homing = False
        self._was_busy = False
        self._ended: list[Ended] = []
        self._events: list[str] = []
        if self._queue:
            self._events.append(f'{len(self._queue)} deliveries were left over: going on')

    @property
    def queue(self) -> DeliveryQueue:
        """Deliveries under way and waiting."""
        return self._queue

    @property
    def current(self) -> str:
        """Id of the delivery under way; '': none is."""
        return self._current

    def submit(self, delivery: Delivery, stamp: int, wait_for_turn: bool = False) -> None:
        """Take a delivery; it has been kept when this returns.

        Parameters
        ----------
        delivery : Delivery
        stamp : int
            Now [ns].
        wait_for_turn : bool
            Whether it may wait while another is under way.

        Raises
        ------
        MissionError, PlanningError
            Why it cannot be taken.
        """
        self.mission.check(delivery.tour)
        self._want_charge(stamp)
        busy = self._queue or (self.mission.is_busy and not self._homing)
        if busy and not wait_for_turn:
            raise MissionError(
                'busy with another delivery: cancel it, wait until it is done, or queue this one'
            )
        if len(self._queue) >= self.limit:
            raise MissionError(f'the queue is full: {self.limit} deliveries')
        queue = self._queue.add(delivery)
        if self._save is not None:
            self._save(queue)
        self._queue = queue

    def go(self, stops: tuple[Destination, ...], stamp: int) -> None:
        """Drive to places that nobody waits at; replaces another such drive, never a delivery.

        Raises
        ------
        MissionError, PlanningError
        """
        if self._queue:
            raise MissionError('busy with a delivery: cancel it or wait until it is done')
        self._want_charge(stamp)
        self.mission.cancel('replaced by another goal')
        self._homing = False
        self.mission.start(stops)

    def go_home(self) -> None:
        """Drive home; a delivery or a goal that comes replaces that.

        Raises
        ------
        MissionError, PlanningError
            Something is under way, or there is no home.
        """
        if self.mission.is_busy or self._queue:
            raise MissionError('busy: cancel what is under way first')
        self.mission.take(self.mission.tour_of((), return_home=True))
        self._homing = True
        self._events.append('going home')

    def cancel(self, delivery_id: str, reason: str = 'cancelled') -> bool:
        """End a delivery, under way or waiting; return whether there was one."""
        delivery = self._queue.find(delivery_id)
        if delivery is None:
            return False
        if delivery_id == self._current:
            self.mission.cancel(reason)
        else:
            self._end(Ended(delivery_id, MissionState.CANCELLED, delivery.tour.abandon(reason)))
        return True

    def cancel_current(self, reason: str = 'cancelled') -> None:
        """End what is under way, a delivery or a goal.

        Raises
        ------
        MissionError
            Nothing is.
        """
        if not self.mission.is_busy:
            raise MissionError('nothing to cancel: nothing is under way')
        self.mission.cancel(reason)

    def step(self, situation: Situation) -> DispatchStep:
        """Return what to drive now, and what happened."""
        stamp = situation.stamp
        if not (self._current or (self.mission.is_busy and not self._homing)):
            self._start_next(stamp)
            self._was_busy = self._was_busy or self.mission.is_busy
        velocity, status = self.mission.step(situation)
        self._events += status.events
        if self._current:
            self._keep_up(status)
        if status.state.is_final and self._was_busy:
            self._after(status, stamp)
        self._was_busy = self.mission.is_busy
        ended, events = tuple(self._ended), tuple(self._events)
        self._ended, self._events = [], []
        return DispatchStep(velocity, status, ended, events)

    def _start_next(self, stamp: int) -> None:
        """Begin the next delivery, if there is one and the battery allows."""
        delivery = self._queue.first
        if delivery is None or self.battery.is_low(stamp):
            return
        self.mission.cancel('a delivery comes first')
        self._homing = False
        try:
            self.mission.take(delivery.tour)
        except (MissionError, PlanningError) as error:
            tour = delivery.tour.abandon(str(error))
            self._events.append(f'delivery given up: {error}')
            self._end(Ended(delivery.id, MissionState.FAILED, tour))
            return
        self._current = delivery.id
        if self.battery.words(stamp) == 'not known':
            self._events.append('battery charge not known')

    def _keep_up(self, status: MissionStatus) -> None:
        """Keep how far the delivery under way has come."""
        kept, tour = self._queue.find(self._current), self.mission.tour
        if status.state.is_final:
            ended = Ended(self._current, status.state, tour)
            self._current = ''
            self._end(ended)
        elif kept is not None and tour.index != kept.tour.index:
            # Standing at a stop is not kept: who comes back in the middle of a hand-over, waits.
            done = replace(tour, reached=tour.reached[:-1]) if tour.is_standing else tour
            self._change(self._queue.update(Delivery(kept.id, done)))

    def _after(self, status: MissionStatus, stamp: int) -> None:
        """Go home where that is due although nobody asked for it."""
        was_homing, self._homing = self._homing, False
        low = self.battery.is_low(stamp)
        cancelled = status.state is MissionState.CANCELLED
        due = low or (cancelled and self.mission.config.home_after_cancel)
        if was_homing or not due or self.mission.tour.ends_home or (self._queue and not low):
            return
        try:
            self.mission.take(self.mission.tour_of((), return_home=True))
        except (MissionError, PlanningError) as error:
            self._events.append(f'cannot go home: {error}')
            return
        self._homing = True
        why = f'battery at {self.battery.words(stamp)}' if low else 'cancelled'
        self._events.append(f'going home: {why}')

    def _want_charge(self, stamp: int) -> None:
        if self.battery.is_low(stamp):
            least = 100.0 * self.battery.config.min_charge
            raise MissionError(
                f'battery too low: {self.battery.words(stamp)}, at least {least:.0f} % is needed'
            )

    def _end(self, ended: Ended) -> None:
        self._ended.append(ended)
        self._change(self._queue.remove(ended.id))

    def _change(self, queue: DeliveryQueue) -> None:
        """Use another queue, and keep it; the work goes on where that fails, but it is told."""
        self._queue = queue
        if self._save is None:
            return
        try:
            self._save(queue)
        except MissionError as error:
            self.fault = str(error)
            self._events.append(self.fault)
        else:
            self.fault = ''
