"""Deliveries: several stops one after the other, whatever comes in between, and home again.

A state machine in time steps: it gets the situation and returns a velocity and a status. Which
states there are and what leads from one to the other: docs/navigation.md.
"""

from __future__ import annotations

from tablerunner.control.alignment import AlignmentDrive
from tablerunner.control.blockades import BlockadeConfig
from tablerunner.control.caution import CautionConfig
from tablerunner.control.controller import Controller, Drive
from tablerunner.control.destination import Destination, MissionState, MissionStatus, Situation
from tablerunner.control.floor_map import Disc
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.hand_over import HandOver
from tablerunner.control.leg import Leg
from tablerunner.control.look_around import LookAround
from tablerunner.control.lost_watch import LostWatch
from tablerunner.control.marks import disc_ahead
from tablerunner.control.mission_config import MissionConfig
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.control.progress import ProgressWatch
from tablerunner.control.surroundings import Surroundings
from tablerunner.control.tour import Tour, check_stops
from tablerunner.control.way_finder import WayFinder, patience
from tablerunner.errors import MissionError, NoWayError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity, nanoseconds, seconds

_PLAN_RETRY_S = 2.0
_PLAN_TRIES = 4
_LONGEST_STEP_S = 0.5
_NEAR_M = 0.3
_LOOK_PAUSE_S = 12.0
_RETREAT_S = 20.0
_ASIDE_S = 4.0
_RETREAT_AGAIN_S = 30.0


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
        self._paused = False
        self._stay: HandOver | None = None
        self._events: list[str] = []
        self._message = ''
        self._last_stamp = 0
        self._lost = LostWatch()
        self._align = AlignmentDrive(config.align_speed, config.align_turn_rate)
        self._progress = ProgressWatch()
        self._look = LookAround(_LOOK_PAUSE_S)
        self._leg = Leg(config.replan_after)
        self._saved_s = 0.0  # of the time that the stops so far were given

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
        self._tour = tour
        self._message, self._paused = '', False
        self._lost.restart()
        self._begin_leg()
        self._saved_s = 0.0
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
        self._leg.path = None  # the robot may be moved meanwhile
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
        self._progress.restart()
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
            self._ways.hear(readings, situation.pose, situation.stamp)
        velocity: Velocity | None = None
        if self.is_busy and not self._paused:
            velocity = self._advance(situation, elapsed)
            if velocity is not None and situation.pose is not None:
                velocity = self._ways.caution.slowed(velocity, situation.pose, situation.stamp)
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
            self._leg.distance_left,
            self._leg.path if self.is_busy else None,
            tour.reached,
            tour.missed,
            tour.unconfirmed,
            tuple(self._events),
            self._message,
        )

    def _advance(self, situation: Situation, elapsed: float) -> Velocity | None:
        """Do one step of a mission under way; None: stand still."""
        dt = min(elapsed, _LONGEST_STEP_S)
        stop, leg = self._tour.goal, self._leg
        if self._stay is not None:
            self._state = self._stay.state
            if self._stay.step(elapsed):
                self._leave()
            return None
        pose = situation.pose
        localised, velocity = self._localise(situation)
        leg.taken_s += elapsed if leg.begun else 0.0
        if not localised or pose is None or stop is None:
            self._progress.restart()
            return velocity
        leg.begun = True
        limit = self.config.stop_limit + self._saved_s
        if leg.taken_s > limit:
            self._miss(f'not reached within {limit:.0f} s')
            return None
        if leg.path is None and not self._plan(situation, pose, stop):
            return None
        if self._ways.is_approached(situation.stamp):
            return None
        if leg.retreat_until:
            return self._make_way(situation, pose, dt)
        self._look_ahead(situation, pose, stop)
        drive = self.controller.step(pose, dt)
        leg.distance_left = drive.distance_left
        if drive.arrived:
            self._arrive(stop)
            return None
        if drive.cross_track > self.config.off_path:
            self._events.append(f'{drive.cross_track:.1f} m off the path: planning anew')
            leg.path = None
            return None
        if situation.held:
            # Not blocked: nobody can be waited for or driven around. The time limit goes on.
            self._progress.restart()
            self._state = MissionState.HELD
        elif not self._watch(situation, pose, stop, drive, dt):
            return None
        elif self._state is MissionState.BLOCKED:
            look = self._look.step(situation.stamp, situation.blocked and leg.stuck)
            return drive.velocity if look is None else look
        return drive.velocity

    def _localise(self, situation: Situation) -> tuple[bool, Velocity | None]:
        """Return whether the pose can be driven on, and what to drive if it cannot."""
        lost, config = self._lost, self.config
        event = lost.look(situation, config)
        if event:
            self._events.append(event)
        if not lost.is_lost:
            if event:
                self._leg.path = None
                self._state = MissionState.PLANNING
            return True, None
        if lost.lost_s(situation.stamp) > config.localise_limit:
            self._end(MissionState.FAILED, f'not localised for {config.localise_limit:.0f} s')
            return False, None
        self._state = MissionState.ALIGNING if lost.aligning else MissionState.LOCALISING
        if not lost.aligning:
            return False, None
        return False, self._align.step(situation.stamp, situation.blocked)

    def _plan(self, situation: Situation, pose: Pose2, stop: Destination) -> bool:
        """Make a path to the stop; False: there is none yet, or the stop was missed."""
        self._state = MissionState.PLANNING
        if situation.stamp < self._leg.plan_again:
            return False
        try:
            path = self._ways.way(pose, stop, situation.stamp)
        except NoWayError as error:
            self._miss(str(error))
            return False
        except PlanningError as error:
            self._leg.plan_tries += 1
            if self._leg.plan_tries >= _PLAN_TRIES:
                self._miss(str(error))
            else:
                self._leg.plan_again = situation.stamp + nanoseconds(_PLAN_RETRY_S)
                self._events.append(f'{error}: trying again')
            return False
        self._leg.plan_tries = 0
        self._follow(path)
        self._events.append(f'{path.length:.1f} m to {stop.name}')
        return True

    def _look_ahead(self, situation: Situation, pose: Pose2, stop: Destination) -> None:
        """Take another way where something was found on this one."""
        leg = self._leg
        if leg.path is None:
            return
        path = self._ways.other_way(situation.stamp, pose, stop, leg.path, leg.distance_left)
        if path is None:
            return
        self._events.append(f'something in the way: round it in {path.length:.1f} m')
        leg.path, leg.distance_left = path, path.length
        self.controller.follow(path)
        if self._ways.has_moved(pose):
            self._progress.restart()

    def _follow(self, path: Path) -> None:
        self._leg.path = path
        self._leg.distance_left = path.length
        self._ways.begin()
        self.controller.follow(path)
        self._progress.restart()
        self._state = self._moving

    @property
    def _moving(self) -> MissionState:
        return MissionState.RETURNING if self._tour.is_returning else MissionState.DRIVING

    def _watch(
        self, situation: Situation, pose: Pose2, stop: Destination, drive: Drive, dt: float
    ) -> bool:
        """Look whether the robot gets on; False: the stop was given up, or is near enough."""
        config = self.config
        stuck_s = self._progress.stuck_s(
            situation.stamp,
            pose,
            drive.distance_left,
            situation.blocked or self._state is MissionState.BLOCKED,
        )
        self._leg.stuck = stuck_s >= config.look_after
        if stuck_s < config.blocked_after:
            self._state = self._moving
            self._leg.replan_at = config.replan_after
            return True
        if self._state is not MissionState.BLOCKED:
            self._events.append(f'blocked on the way to {stop.name}')
        self._state = MissionState.BLOCKED
        self._leg.blocked_s += dt
        if self._leg.blocked_s > config.give_up_after:
            self._miss(f'way blocked for {self._leg.blocked_s:.0f} s')
            return False
        if stuck_s >= self._leg.replan_at:
            off = pose.distance_to(stop.pose)
            if off <= _NEAR_M:  # a pose that is off by this much lets it come no nearer
                self._events.append(f'as near to {stop.name} as it gets: {off:.2f} m')
                self._arrive(stop)
                return False
            self._leg.replan_at = stuck_s + config.replan_after
            self._around(situation, pose, stop, stuck_s)
        return True

    def _around(
        self, situation: Situation, pose: Pose2, stop: Destination, stuck_s: float
    ) -> None:
        """Look for a way around what is in the way; keep waiting before it if there is none.

        For a long way round it is worth to wait a little: people move on. The oftener something
        was met here, the less.
        """
        left = self._leg.distance_left
        mark = disc_ahead(situation, pose, self.planner.footprint_radius)
        times = self._ways.meet(mark, situation.stamp, self.config.mark_time)
        try:
            path = self._ways.way_around(pose, stop, situation.stamp)
        except PlanningError as error:
            if not self._retreats(situation, pose, mark):
                self._wait_before(situation, pose, stop, error)
            return
        if stuck_s < self.config.replan_after + patience(path.length - left) / times:
            self._events.append(f'a way around of {path.length:.1f} m is long: waiting')
            return
        self._follow(path)
        self._state = MissionState.BLOCKED
        self._events.append(f'a way around of {path.length:.1f} m')

    def _retreats(self, situation: Situation, pose: Pose2, mark: Disc) -> bool:
        """Begin to make way for who stands in the way; False: it cannot, or has just done so."""
        leg = self._leg
        if leg.path is None or situation.stamp < leg.retreat_again:
            return False
        path = self._ways.refuge(pose, mark, leg.path, leg.distance_left)
        if path is None:
            return False
        self._follow(path)
        self._state = MissionState.BLOCKED
        leg.retreat_until = situation.stamp + nanoseconds(_RETREAT_S)
        leg.retreat_again = situation.stamp + nanoseconds(_RETREAT_AGAIN_S)
        leg.retreated = False
        self._events.append(f'making way: {path.length:.1f} m aside')
        return True

    def _make_way(self, situation: Situation, pose: Pose2, dt: float) -> Velocity | None:
        """Drive out of somebody's way, stand there for a while, then plan anew."""
        leg = self._leg
        if situation.stamp >= leg.retreat_until:
            leg.retreat_until, leg.path = 0, None
            return None
        if leg.retreated:
            return None
        drive = self.controller.step(pose, dt)
        if drive.arrived:
            leg.retreated = True
            leg.retreat_until = situation.stamp + nanoseconds(_ASIDE_S)
        return drive.velocity

    def _wait_before(
        self, situation: Situation, pose: Pose2, stop: Destination, error: PlanningError
    ) -> None:
        """Keep waiting before what is in the way; give the stop up if it is there to stay."""
        try:
            self._ways.lasting_way(pose, stop, situation.stamp)
        except NoWayError as blocked:
            self._miss(str(blocked))
        except PlanningError:
            pass
        else:
            self._events.append(f'no way around ({error}): waiting')

    def _arrive(self, stop: Destination) -> None:
        self._tour = self._tour.arrive()
        self._events.append(f'reached {stop.name}')
        self._leg.distance_left = 0.0
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
        self._begin_leg()
        if self._tour.goal is None:
            self._finish(MissionState.DONE if self._tour.is_success else MissionState.FAILED)
        else:
            self._state = MissionState.PLANNING

    def _begin_leg(self) -> None:
        """Forget what concerned one stop only."""
        self._ways.forget()
        self._saved_s += self.config.stop_limit - self._leg.taken_s
        self._leg = Leg(self.config.replan_after)
        self._stay = None
        self._progress.restart()

    def _end(self, state: MissionState, reason: str) -> None:
        if self._stay is not None:  # it stands where it was to go
            self._tour = self._tour.leave(not self._stay.wants_confirmation)
            self._stay = None
        self._tour = self._tour.abandon(reason)
        self._finish(state)

    def _finish(self, state: MissionState) -> None:
        self._state, self._paused = state, False
        self._leg.path = None
        self._message = self._tour.message
        self._events.append(f'{state.value}: {self._message}')
