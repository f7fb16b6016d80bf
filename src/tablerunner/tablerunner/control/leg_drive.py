"""The way to one stop: planning, following, and what to do when something holds the robot up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from tablerunner.control.controller import Controller, Drive
from tablerunner.control.destination import Destination, Situation
from tablerunner.control.floor_map import Disc
from tablerunner.control.leg import Leg
from tablerunner.control.look_around import LookAround
from tablerunner.control.marks import disc_ahead
from tablerunner.control.mission_config import MissionConfig
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.control.progress import ProgressWatch
from tablerunner.control.way_finder import WayFinder, patience
from tablerunner.errors import NoWayError, PlanningError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity, nanoseconds

_PLAN_RETRY_S = 2.0
_PLAN_TRIES = 4
_NEAR_M = 0.3
_LOOK_PAUSE_S = 8.0  # no longer than echoes are remembered, or what is there is forgotten
_RETREAT_S = 40.0
_ASIDE_S = 8.0
_FACE_RATE, _FACING_RAD = 0.6, 0.15
_RETREAT_AGAIN_S = 30.0


class LegPhase(Enum):
    """How the robot gets on."""

    PLANNING = 'planning'
    DRIVING = 'driving'
    BLOCKED = 'blocked'
    HELD = 'held'


@dataclass(frozen=True, slots=True)
class LegStep:
    """What one step of a leg asks for, and how it ends.

    Attributes
    ----------
    velocity : Velocity or None
        None: stand still.
    arrived : bool
        Whether the robot is at the stop.
    missed : str
        Why the stop cannot be reached; empty while it may.
    """

    velocity: Velocity | None = None
    arrived: bool = False
    missed: str = ''


_STAND = LegStep()


class LegDrive:
    """Takes the robot to one stop after the other; a pose to drive on is given.

    Parameters
    ----------
    config : MissionConfig
    planner : Planner
    controller : Controller
        Follows the planned paths.
    ways : WayFinder

    Attributes
    ----------
    phase : LegPhase
    events : list of str
        What happened, in words; whoever reads them empties the list.
    """

    def __init__(
        self, config: MissionConfig, planner: Planner, controller: Controller, ways: WayFinder
    ) -> None:
        self.config = config
        self.planner = planner
        self.phase = LegPhase.PLANNING
        self.events: list[str] = []
        self._controller = controller
        self._ways = ways
        self._progress = ProgressWatch()
        self._look = LookAround(_LOOK_PAUSE_S)
        self._leg = Leg(config.replan_after)

    @property
    def path(self) -> Path | None:
        """What is being followed."""
        return self._leg.path

    @property
    def distance_left(self) -> float:
        """What is left of it [m]; NaN: not known."""
        return self._leg.distance_left

    @property
    def taken_s(self) -> float:
        """Time since the robot was localised on this leg, without pauses [s]."""
        return self._leg.taken_s

    def begin(self) -> None:
        """Begin the way to another stop: forget what concerned the last one only."""
        self._ways.forget()
        self._leg = Leg(self.config.replan_after)
        self.phase = LegPhase.PLANNING
        self._progress.restart()

    def interrupt(self) -> None:
        """Plan anew before driving on: the robot may be elsewhere by then."""
        self._leg.path = None
        self.phase = LegPhase.PLANNING

    def rest(self) -> None:
        """Do not take the time until now for a lack of progress."""
        self._progress.restart()

    def arrive(self) -> None:
        """Take note that nothing is left to drive."""
        self._leg.distance_left = 0.0

    def wait(self, elapsed: float) -> None:
        """Let time [s] go by; it counts once the leg has begun."""
        self._leg.taken_s += elapsed if self._leg.begun else 0.0

    def step(
        self, situation: Situation, pose: Pose2, stop: Destination, dt: float, limit_s: float
    ) -> LegStep:
        """Do one step.

        Parameters
        ----------
        situation : Situation
        pose : Pose2
            base_link in map.
        stop : Destination
        dt : float
            Since the last step [s].
        limit_s : float
            Time that the leg may take in all [s].
        """
        leg = self._leg
        leg.begun = True
        if leg.taken_s > limit_s:
            return LegStep(missed=f'not reached within {limit_s:.0f} s')
        if leg.path is None:
            planned = self._plan(situation, pose, stop)
            if planned is not None:
                return planned
        if self._ways.is_approached(situation.stamp):
            return _STAND
        if leg.retreat_until:
            return self._make_way(situation, pose, stop, dt)
        self._look_ahead(situation, pose, stop)
        drive = self._controller.step(pose, dt)
        leg.distance_left = drive.distance_left
        if drive.arrived:
            return LegStep(arrived=True)
        if drive.cross_track > self.config.off_path:
            self.events.append(f'{drive.cross_track:.1f} m off the path: planning anew')
            leg.path = None
            return _STAND
        if situation.held:
            # Not blocked: nobody can be waited for or driven around. The time limit goes on.
            self._progress.restart()
            self.phase = LegPhase.HELD
            return LegStep(drive.velocity)
        return self._watch(situation, pose, stop, drive, dt)

    def _plan(self, situation: Situation, pose: Pose2, stop: Destination) -> LegStep | None:
        """Make a path to the stop; return what to do while there is none."""
        leg = self._leg
        self.phase = LegPhase.PLANNING
        if situation.stamp < leg.plan_again:
            return _STAND
        try:
            path = self._ways.way(pose, stop, situation.stamp)
        except NoWayError as error:
            return LegStep(missed=str(error))
        except PlanningError as error:
            leg.plan_tries += 1
            if leg.plan_tries >= _PLAN_TRIES:
                return LegStep(missed=str(error))
            leg.plan_again = situation.stamp + nanoseconds(_PLAN_RETRY_S)
            self.events.append(f'{error}: trying again')
            return _STAND
        leg.plan_tries = 0
        self._follow(path, LegPhase.DRIVING)
        self.events.append(f'{path.length:.1f} m to {stop.name}')
        return None

    def _look_ahead(self, situation: Situation, pose: Pose2, stop: Destination) -> None:
        """Take another way where something was found on this one."""
        leg = self._leg
        if leg.path is None:
            return
        path = self._ways.other_way(situation.stamp, pose, stop, leg.path, leg.distance_left)
        if path is None:
            return
        self.events.append(f'something in the way: round it in {path.length:.1f} m')
        leg.path, leg.distance_left = path, path.length
        self._controller.follow(path)
        if self._ways.has_moved(pose):
            self._progress.restart()

    def _follow(self, path: Path, phase: LegPhase) -> None:
        self._leg.path = path
        self._leg.distance_left = path.length
        self._ways.begin()
        self._controller.follow(path)
        self._progress.restart()
        self.phase = phase

    def _watch(
        self, situation: Situation, pose: Pose2, stop: Destination, drive: Drive, dt: float
    ) -> LegStep:
        """Look whether the robot gets on, and what to do if it does not."""
        config, leg = self.config, self._leg
        stuck_s = self._progress.stuck_s(
            situation.stamp,
            pose,
            drive.distance_left,
            situation.blocked or self.phase is LegPhase.BLOCKED,
        )
        leg.stuck = stuck_s >= config.look_after
        if stuck_s < config.blocked_after:
            self.phase = LegPhase.DRIVING
            leg.replan_at = config.replan_after
            return LegStep(drive.velocity)
        if self.phase is not LegPhase.BLOCKED:
            self.events.append(f'blocked on the way to {stop.name}')
        self.phase = LegPhase.BLOCKED
        leg.blocked_s += dt
        if leg.blocked_s > config.give_up_after:
            return LegStep(missed=f'way blocked for {leg.blocked_s:.0f} s')
        if stuck_s >= leg.replan_at:
            off = pose.distance_to(stop.pose)
            if off <= _NEAR_M:  # a pose that is off by this much lets it come no nearer
                self.events.append(f'as near to {stop.name} as it gets: {off:.2f} m')
                return LegStep(arrived=True)
            leg.replan_at = stuck_s + config.replan_after
            stays = self._around(situation, pose, stop, stuck_s)
            if stays:
                return LegStep(missed=stays)
        look = self._look.step(situation.stamp, situation.blocked and leg.stuck)
        return LegStep(drive.velocity if look is None else look)

    def _around(self, situation: Situation, pose: Pose2, stop: Destination, stuck_s: float) -> str:
        """Look for a way around what is in the way; keep waiting before it if there is none.

        For a long way round it is worth to wait a little: people move on. The oftener something
        was met here, the less. Returns why the stop cannot be reached, if what is in the way is
        there to stay.
        """
        left = self._leg.distance_left
        mark = disc_ahead(situation, pose, self.planner.footprint_radius)
        times = self._ways.meet(mark, situation.stamp, self.config.mark_time, stuck_s)
        try:
            path = self._ways.way_around(pose, stop, situation.stamp)
        except PlanningError as error:
            # He who stands there has had time to go: is it somebody at all?
            patient_s = self.config.replan_after * (1 if times == 1 else 2)
            if stuck_s >= patient_s and self._retreats(situation, pose, mark):
                return ''
            return self._wait_before(situation, pose, stop, error)
        if stuck_s < self.config.replan_after + patience(path.length - left) / times:
            self.events.append(f'a way around of {path.length:.1f} m is long: waiting')
            return ''
        self._follow(path, LegPhase.BLOCKED)
        self.events.append(f'a way around of {path.length:.1f} m')
        return ''

    def _wait_before(
        self, situation: Situation, pose: Pose2, stop: Destination, error: PlanningError
    ) -> str:
        """Keep waiting before what is in the way; return why not, if it is there to stay."""
        try:
            self._ways.lasting_way(pose, stop, situation.stamp)
        except NoWayError as blocked:
            return str(blocked)
        except PlanningError:
            return ''
        self.events.append(f'no way around ({error}): waiting')
        return ''

    def _retreats(self, situation: Situation, pose: Pose2, mark: Disc) -> bool:
        """Begin to make way for who stands in the way; False: it cannot, or has just done so."""
        leg = self._leg
        if leg.path is None or situation.stamp < leg.retreat_again:
            return False
        path = self._ways.refuge(pose, mark, leg.path, leg.distance_left)
        if path is None:
            return False
        self._follow(path, LegPhase.BLOCKED)
        leg.retreat_until = situation.stamp + nanoseconds(_RETREAT_S)
        leg.retreat_again = situation.stamp + nanoseconds(_RETREAT_AGAIN_S)
        leg.retreated, leg.retreat_from = False, mark
        self.events.append(f'making way: {path.length:.1f} m aside')
        return True

    def _make_way(
        self, situation: Situation, pose: Pose2, stop: Destination, dt: float
    ) -> LegStep:
        """Drive out of somebody's way, face him for a while or until he is gone, plan anew."""
        leg = self._leg
        over = situation.stamp >= leg.retreat_until
        if over or (leg.retreated and self._ways.is_free(situation.stamp, pose, stop)):
            leg.retreat_until, leg.path = 0, None
            return _STAND
        if leg.retreated:
            return LegStep(_turn_to(pose, leg.retreat_from))
        drive = self._controller.step(pose, dt)
        if drive.arrived:
            leg.retreated = True
            leg.retreat_until = situation.stamp + nanoseconds(_ASIDE_S)
        return LegStep(drive.velocity)


def _turn_to(pose: Pose2, disc: Disc) -> Velocity | None:
    """Return the velocity of turning to face a place; None: the robot faces it."""
    course = math.atan2(disc.y - pose.y, disc.x - pose.x)
    error = difference(course, pose.heading)
    if abs(error) < _FACING_RAD:
        return None
    return Velocity(0.0, math.copysign(min(_FACE_RATE, 2.0 * abs(error)), error))
