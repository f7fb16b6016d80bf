"""Deliveries: several stops one after the other, whatever comes in between, and home again.

A state machine in time steps: it gets the situation and returns a velocity and a status. Which
states there are and what leads from one to the other: docs/navigation.md.
"""

from __future__ import annotations

from tablerunner.control.alignment import AlignmentDrive
from tablerunner.control.blockades import BlockadeConfig
from tablerunner.control.caution import CautionConfig
from tablerunner.control.controller import Controller
from tablerunner.control.destination import Destination, MissionState, MissionStatus, Situation
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.hand_over import HandOver
from tablerunner.control.leg_drive import LegDrive, LegPhase
from tablerunner.control.lost_watch import LostWatch
from tablerunner.control.mission_config import MissionConfig
from tablerunner.control.planner import Planner
from tablerunner.control.surroundings import Surroundings
from tablerunner.control.tour import Tour, check_stops
from tablerunner.control.way_finder import WayFinder
from tablerunner.errors import MissionError
from tablerunner.types import Velocity, seconds

_LONGEST_STEP_S = 0.5
_RESERVED_SHARE = 0.5  # of the time of a stop, for each stop that follows
_STATES = {
    LegPhase.PLANNING: MissionState.PLANNING,
    LegPhase.DRIVING: MissionState.DRIVING,
    LegPhase.BLOCKED: MissionState.BLOCKED,
    LegPhase.HELD: MissionState.HELD,
}


class Mission:
    """Takes the robot to its stops; one mission at a time.

    Parameters
    ----------
    config : MissionConfig
    planner : Planner
    controller : Controller
        Follows the planned paths.
    home : Destination or None
        Where a mission with ``return_home`` ends.
    surroundings : Surroundings or None
        What the sensors find that is not on the map is planned round, when they are told of.
    caution : CautionConfig, optional
    blockades : BlockadeConfig, optional
    """

    def __init__(
        self,
        config: MissionConfig,
        planner: Planner,
        controller: Controller,
        home: Destination | None = None,
        surroundings: Surroundings | None = None,
        caution: CautionConfig | None = None,
        blockades: BlockadeConfig | None = None,
    ) -> None:
        self.config = config
        self.planner = planner
        self.controller = controller
        self.home = home
        self._ways = WayFinder(planner, surroundings, caution, blockades)
        self._readings: Readings | None = None
        self._state = MissionState.IDLE
        self._tour = Tour(())
        self._spent_s = 0.0  # on the way to the stops before
        self._paused = False
        self._stay: HandOver | None = None
        self._events: list[str] = []
        self._message = ''
        self._last_stamp = 0
        self._lost = LostWatch()
        self._align = AlignmentDrive(config.align_speed, config.align_turn_rate)
        self._drive = LegDrive(config, planner, controller, self._ways)

    @property
    def is_busy(self) -> bool:
        """Whether a mission is under way."""
        return not self._state.is_final

    def configure(
        self,
        config: MissionConfig,
        planner: Planner,
        caution: CautionConfig | None = None,
        blockades: BlockadeConfig | None = None,
    ) -> None:
        """Use other settings from now on; a mission under way goes on."""
        self.config = config
        self.planner = planner
        self._drive.config, self._drive.planner = config, planner
        self._ways.configure(planner, caution, blockades)
        self._align = AlignmentDrive(config.align_speed, config.align_turn_rate)

    def start(self, stops: tuple[Destination, ...], return_home: bool = False) -> None:
        """Take on a mission; see `take` for what it raises."""
        if not stops:
            raise MissionError('a delivery needs at least one stop')
        self.take(self.tour_of(stops, return_home))

    def tour_of(self, stops: tuple[Destination, ...], return_home: bool) -> Tour:
        """Return a tour of some stops, and home.

        Raises
        ------
        MissionError
            There is no home to return to.
        """
        if return_home and self.home is None:
            raise MissionError('there is no home to return to')
        return Tour(stops, self.home if return_home else None)

    def take(self, tour: Tour) -> None:
        """Take on a tour, from the stop that is next.

        Raises
        ------
        MissionError
            A mission is under way, or nothing is left of the tour.
        PlanningError
            The robot cannot stand at one of the stops; which and why.
        """
        if self.is_busy:
            raise MissionError('busy with another delivery: cancel it or wait until it is done')
        self.check(tour)
        self._tour, self._spent_s = tour, 0.0
        self._message, self._paused = '', False
        self._lost.restart()
        self._begin_leg()
        self._state = MissionState.PLANNING

    def check(self, tour: Tour) -> None:
        """Look whether a tour can be taken on at all; see `take`."""
        check_stops(tour, self.planner)

    def hear(self, readings: Readings) -> None:
        """Take what the ultrasonic sensors hear now; counts for the next step only."""
        self.controller.hear(readings)
        self._readings = readings

    def cancel(self, reason: str = 'cancelled') -> None:
        """End the mission; the stops that were not reached are missed for this reason."""
        if self.is_busy:
            self._end(MissionState.CANCELLED, reason)

    def confirm(self) -> str:
        """Take note that the hand-over is done; return where.

        Raises
        ------
        MissionError
            The robot stands at no stop that wants a confirmation.
        """
        stop = self._tour.goal
        if self._stay is None or stop is None or not self._stay.wants_confirmation:
            raise MissionError('nothing to confirm: the robot is not handing over')
        self._stay.confirm()
        self._events.append(f'{stop.name} confirmed')
        return stop.name

    def pause(self) -> None:
        """Come to a stand and stay; no time limit runs meanwhile.

        Raises
        ------
        MissionError
            Nothing is under way, or it is paused already.
        """
        if not self.is_busy:
            raise MissionError('nothing to pause: nothing is under way')
        if self._paused:
            raise MissionError('paused already')
        self._paused = True
        self._drive.interrupt()  # the robot may be moved meanwhile
        self._events.append('paused')

    def resume(self) -> None:
        """Go on after a pause.

        Raises
        ------
        MissionError
            It is not paused.
        """
        if not self._paused:
            raise MissionError('nothing to resume: not paused')
        self._paused = False
        self._drive.rest()
        self._lost.restart()
        if self._stay is None:
            self._state = MissionState.PLANNING
        self._events.append('resumed')

    def skip(self, reason: str = 'skipped on request') -> str:
        """Leave the stop that is next, or at which the robot stands, and go on; return its name.

        Raises
        ------
        MissionError
            Nothing is under way, or only the way home is left.
        """
        stop = self._tour.goal
        if not self.is_busy or stop is None:
            raise MissionError('nothing to skip: nothing is under way')
        if self._tour.is_returning:
            raise MissionError('nothing to skip: it is on its way home')
        if self._stay is None:
            self._miss(reason)
        else:
            self._leave()
        return stop.name

    def step(self, situation: Situation) -> tuple[Velocity, MissionStatus]:
        """Return what to drive now and how the mission stands."""
        elapsed = seconds(situation.stamp - self._last_stamp) if self._last_stamp else 0.0
        elapsed = max(elapsed, 0.0)
        self._last_stamp = situation.stamp
        readings, self._readings = self._readings, None
        if readings is not None and situation.pose is not None and not self._lost.is_lost:
            self._ways.hear(readings, situation.pose, situation.stamp, situation.position_std_m)
        velocity: Velocity | None = None
        if self.is_busy and not self._paused:
            velocity = self._advance(situation, elapsed)
            if velocity is not None and situation.pose is not None:
                velocity = self._ways.caution.slowed(velocity, situation.pose, situation.stamp)
                self.controller.drive(velocity)
        if velocity is None:
            velocity = self.controller.halt(min(elapsed, _LONGEST_STEP_S))
        status = self.status
        self._events = []
        return velocity, status

    @property
    def tour(self) -> Tour:
        """The stops, and what has become of them so far."""
        return self._tour

    @property
    def status(self) -> MissionStatus:
        """How the mission stands."""
        tour, goal = self._tour, self._tour.goal
        return MissionStatus(
            MissionState.PAUSED if self._paused else self._state,
            tour.index,
            '' if goal is None else goal.name,
            self._drive.distance_left,
            self._drive.path if self.is_busy else None,
            tour.reached,
            tour.missed,
            tour.unconfirmed,
            tuple(self._events),
            self._message,
        )

    def _advance(self, situation: Situation, elapsed: float) -> Velocity | None:
        """Do one step of a mission under way; None: stand still."""
        dt = min(elapsed, _LONGEST_STEP_S)
        stop = self._tour.goal
        if self._stay is not None:
            self._state = self._stay.state
            if self._stay.step(elapsed):
                self._leave()
            return None
        pose, drive = situation.pose, self._drive
        localised, velocity = self._localise(situation)
        drive.wait(elapsed)
        if not localised or pose is None or stop is None:
            drive.rest()
            return velocity
        step = drive.step(situation, pose, stop, dt, self._limit_s)
        self._events.extend(drive.events)
        drive.events.clear()
        self._state = self._driving_state
        if step.arrived:
            self._arrive(stop)
        elif step.missed:
            self._miss(step.missed)
        return step.velocity

    @property
    def _limit_s(self) -> float:
        """Time that the way to this stop may take, so that some is left for those after it [s]."""
        config, tour = self.config, self._tour
        left_s = config.tour_limit * len(tour.legs) - self._spent_s
        reserved_s = _RESERVED_SHARE * config.tour_limit * (len(tour.legs) - tour.index - 1)
        return min(config.stop_limit, left_s - reserved_s)

    @property
    def _driving_state(self) -> MissionState:
        phase = self._drive.phase
        if phase is LegPhase.DRIVING and self._tour.is_returning:
            return MissionState.RETURNING
        return _STATES[phase]

    def _localise(self, situation: Situation) -> tuple[bool, Velocity | None]:
        """Return whether the pose can be driven on, and what to drive if it cannot."""
        lost, config = self._lost, self.config
        event = lost.look(situation, config)
        if event:
            self._events.append(event)
        if not lost.is_lost:
            if event:
                self._drive.interrupt()
            return True, None
        if lost.lost_s(situation.stamp) > config.localise_limit:
            self._end(MissionState.FAILED, f'not localised for {config.localise_limit:.0f} s')
            return False, None
        self._state = MissionState.ALIGNING if lost.aligning else MissionState.LOCALISING
        if not lost.aligning:
            return False, None
        return False, self._align.step(situation.stamp, situation.blocked)

    def _arrive(self, stop: Destination) -> None:
        self._tour = self._tour.arrive()
        self._events.append(f'reached {stop.name}')
        self._drive.arrive()
        self._stay = HandOver(stop)
        self._state = self._stay.state
        if self._stay.step(0.0):
            self._leave()

    def _leave(self) -> None:
        """Go on from the stop where the robot stands."""
        stop, confirmed = self._tour.goal, True
        if self._stay is not None and self._stay.wants_confirmation and stop is not None:
            confirmed = False
            self._events.append(f'{stop.name} not confirmed')
        self._tour = self._tour.leave(confirmed)
        self._next()

    def _miss(self, reason: str) -> None:
        self._tour = self._tour.miss(reason)
        self._events.append('missed {}: {}'.format(*self._tour.missed[-1]))
        self._next()

    def _next(self) -> None:
        self._spent_s += self._drive.taken_s
        self._begin_leg()
        if self._tour.goal is None:
            self._finish(MissionState.DONE if self._tour.is_success else MissionState.FAILED)
        else:
            self._state = MissionState.PLANNING

    def _begin_leg(self) -> None:
        """Forget what concerned one stop only."""
        self._drive.begin()
        self._stay = None

    def _end(self, state: MissionState, reason: str) -> None:
        if self._stay is not None:  # it stands where it was to go
            self._tour = self._tour.leave(not self._stay.wants_confirmation)
            self._stay = None
        self._tour = self._tour.abandon(reason)
        self._finish(state)

    def _finish(self, state: MissionState) -> None:
        self._state, self._paused = state, False
        self._drive.interrupt()
        self._message = self._tour.message
        self._events.append(f'{state.value}: {self._message}')
