"""Deliveries: several stops one after the other, whatever comes in between, and home again.

A state machine in time steps: it gets the situation and returns a velocity and a status. Which
states there are and what leads from one to the other: docs/navigation.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.control.alignment import AlignmentDrive
from tablerunner.control.controller import Controller, Drive
from tablerunner.control.destination import Destination, MissionState, MissionStatus, Situation
from tablerunner.control.floor_map import Disc
from tablerunner.control.look_around import LookAround
from tablerunner.control.mission_config import MissionConfig
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.control.progress import ProgressWatch
from tablerunner.errors import MissionError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity, nanoseconds, seconds

_MARK_RADIUS_M = 0.3
_PLAN_RETRY_S = 2.0
_PLAN_TRIES = 4


@dataclass
class _Leg:
    """What concerns the way to one stop only."""

    replan_at: float  # [s] without progress
    path: Path | None = None
    distance_left: float = math.nan
    begun: int | None = None
    wait_until: int = 0
    plan_again: int = 0
    plan_tries: int = 0
    blocked_s: float = 0.0
    stuck: bool = False


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
    """

    def __init__(
        self,
        config: MissionConfig,
        planner: Planner,
        controller: Controller,
        home: Destination | None = None,
    ) -> None:
        self.config = config
        self.planner = planner
        self.controller = controller
        self.home = home
        self._state = MissionState.IDLE
        self._stops: tuple[Destination, ...] = ()
        self._tour: tuple[Destination, ...] = ()  # the stops, and home
        self._index = 0
        self._reached: list[str] = []
        self._missed: list[tuple[str, str]] = []
        self._events: list[str] = []
        self._message = ''
        self._last_stamp = 0
        self._lost_since: int | None = None
        self._aligning = False
        self._align = AlignmentDrive(config.align_speed, config.align_turn_rate)
        self._progress = ProgressWatch()
        self._look = LookAround(config.replan_after)
        self._marks: list[tuple[int, Disc]] = []  # (until, where)
        self._leg = _Leg(config.replan_after)

    @property
    def is_busy(self) -> bool:
        """Whether a mission is under way."""
        return not self._state.is_final

    def configure(self, config: MissionConfig, planner: Planner) -> None:
        """Use other settings from now on; a mission under way goes on."""
        self.config = config
        self.planner = planner
        self._align = AlignmentDrive(config.align_speed, config.align_turn_rate)

    def start(self, stops: tuple[Destination, ...], return_home: bool = False) -> None:
        """Take on a mission.

        Raises
        ------
        MissionError
            One is under way, there is no stop, or there is no home to return to.
        PlanningError
            The robot cannot stand at one of the stops; which and why.
        """
        if self.is_busy:
            raise MissionError('busy with another delivery: cancel it or wait until it is done')
        if not stops:
            raise MissionError('a delivery needs at least one stop')
        if return_home and self.home is None:
            raise MissionError('there is no home to return to')
        for stop in stops:
            if not (math.isfinite(stop.wait_s) and stop.wait_s >= 0.0):
                raise MissionError(f'{stop.name}: the wait must be at least 0 s')
            try:
                self.planner.check_goal(stop.pose)
            except PlanningError as error:
                raise PlanningError(f'{stop.name}: {error}') from None
        self._stops = stops
        self._tour = (*stops, self.home) if return_home and self.home is not None else stops
        self._index = 0
        self._reached, self._missed, self._events = [], [], []
        self._message = ''
        self._lost_since, self._aligning, self._marks = None, False, []
        self._leave_stop()
        self._state = MissionState.PLANNING

    def cancel(self, reason: str = 'cancelled') -> None:
        """End the mission; the stops that were not reached are missed for this reason."""
        if self.is_busy:
            self._end(MissionState.CANCELLED, reason)

    def step(self, situation: Situation) -> tuple[Velocity, MissionStatus]:
        """Return what to drive now and how the mission stands."""
        dt = seconds(situation.stamp - self._last_stamp) if self._last_stamp else 0.0
        dt = min(max(dt, 0.0), 0.5)
        self._last_stamp = situation.stamp
        velocity: Velocity | None = None
        if self.is_busy:
            velocity = self._advance(situation, dt)
        if velocity is None:
            velocity = self.controller.halt(dt)
        status = self.status
        self._events = []
        return velocity, status

    @property
    def status(self) -> MissionStatus:
        """How the mission stands."""
        stop = self._tour[self._index].name if self._index < len(self._tour) else ''
        return MissionStatus(
            self._state,
            self._index,
            stop,
            self._leg.distance_left,
            self._leg.path if self.is_busy else None,
            tuple(self._reached),
            tuple(self._missed),
            tuple(self._events),
            self._message,
        )

    def _advance(self, situation: Situation, dt: float) -> Velocity | None:
        """Do one step of a mission under way; None: stand still."""
        stop = self._tour[self._index]
        if self._state is MissionState.WAITING:
            if situation.stamp >= self._leg.wait_until:
                self._next()
            return None
        pose = situation.pose
        localised, velocity = self._localise(situation)
        if not localised or pose is None:
            self._progress.restart()
            return velocity
        if self._leg.begun is None:
            self._leg.begun = situation.stamp
        if seconds(situation.stamp - self._leg.begun) > self.config.stop_limit:
            self._miss(f'not reached within {self.config.stop_limit:.0f} s')
            return None
        if self._leg.path is None and not self._plan(situation, pose, stop):
            return None
        drive = self.controller.step(pose, dt)
        self._leg.distance_left = drive.distance_left
        if drive.arrived:
            self._arrive(situation.stamp, stop)
            return None
        if drive.cross_track > self.config.off_path:
            self._events.append(f'{drive.cross_track:.1f} m off the path: planning anew')
            self._leg.path = None
            return None
        if situation.held:
            # Not blocked: nobody can be waited for or driven around. The time limit goes on.
            self._progress.restart()
            self._state = MissionState.HELD
        elif not self._watch(situation, pose, stop, drive, dt):
            return None
        elif self._state is MissionState.BLOCKED:
            look = self._look.step(situation.stamp, situation.blocked and self._leg.stuck)
            return drive.velocity if look is None else look
        return drive.velocity

    def _localise(self, situation: Situation) -> tuple[bool, Velocity | None]:
        """Return whether the pose can be driven on, and what to drive if it cannot."""
        config = self.config
        known = (
            situation.pose is not None
            and situation.pose.is_finite
            and seconds(situation.stamp - situation.pose_stamp) <= config.pose_timeout
            and situation.position_std_m <= config.position_std_limit
        )
        heading = config.heading_std_found if self._aligning else config.heading_std_lost
        if known and situation.heading_std_rad <= heading:
            if self._lost_since is not None:
                self._events.append('localised')
                self._leg.path = None
                self._state = MissionState.PLANNING
            self._lost_since, self._aligning = None, False
            return True, None
        if self._lost_since is None:
            self._lost_since = situation.stamp
            self._events.append('not localised' if not known else 'heading not known')
        lost_s = seconds(situation.stamp - self._lost_since)
        if lost_s > config.localise_limit:
            self._end(MissionState.FAILED, f'not localised for {config.localise_limit:.0f} s')
            return False, None
        self._aligning = known and lost_s >= config.align_after
        self._state = MissionState.ALIGNING if self._aligning else MissionState.LOCALISING
        if not self._aligning:
            return False, None
        return False, self._align.step(situation.stamp, situation.blocked)

    def _plan(self, situation: Situation, pose: Pose2, stop: Destination) -> bool:
        """Make a path to the stop; False: there is none yet, or the stop was missed."""
        self._state = MissionState.PLANNING
        if situation.stamp < self._leg.plan_again:
            return False
        self._marks = [mark for mark in self._marks if mark[0] > situation.stamp]
        discs = tuple(disc for _, disc in self._marks)
        try:
            path = self.planner.plan(
                pose, stop.pose, keep_heading=stop.keep_heading, blocked=discs
            )
        except PlanningError as error:
            if self._marks:
                self._marks = []  # better wait before it than have no way at all
                return self._plan(situation, pose, stop)
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

    def _follow(self, path: Path) -> None:
        self._leg.path = path
        self._leg.distance_left = path.length
        self.controller.follow(path)
        self._progress.restart()
        self._state = self._moving

    @property
    def _moving(self) -> MissionState:
        home = self._index >= len(self._stops)
        return MissionState.RETURNING if home else MissionState.DRIVING

    def _watch(
        self, situation: Situation, pose: Pose2, stop: Destination, drive: Drive, dt: float
    ) -> bool:
        """Look whether the robot gets on; False: the stop was given up."""
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
            self._leg.replan_at = stuck_s + config.replan_after
            self._around(situation, pose, stop)
        return True

    def _around(self, situation: Situation, pose: Pose2, stop: Destination) -> None:
        """Look for a way around what is in the way; keep waiting before it if there is none."""
        until = situation.stamp + nanoseconds(self.config.mark_time)
        mark = (until, self._blocking(situation, pose))
        kept = [old for old in self._marks if old[0] > situation.stamp]
        try:
            path = self.planner.plan(
                pose,
                stop.pose,
                keep_heading=stop.keep_heading,
                blocked=tuple(disc for _, disc in (*kept, mark)),
            )
        except PlanningError as error:
            self._events.append(f'no way around ({error}): waiting')
            return
        self._marks = [*kept, mark]
        self._follow(path)
        self._state = MissionState.BLOCKED
        self._events.append(f'a way around of {path.length:.1f} m')

    def _blocking(self, situation: Situation, pose: Pose2) -> Disc:
        """Return where the thing in the way is taken to stand, in map."""
        reach = self.planner.footprint_radius + 0.1
        x, y = situation.obstacle if situation.obstacle is not None else (reach, 0.0)
        away = max(math.hypot(x, y), 1e-6)
        # The echo comes from the near side; most of what stands in the way is as deep as the mark.
        share = (max(away, reach) + _MARK_RADIUS_M) / away
        centre = pose @ Pose2(x * share, y * share, 0.0)
        return Disc(centre.x, centre.y, _MARK_RADIUS_M)

    def _arrive(self, stamp: int, stop: Destination) -> None:
        self._reached.append(stop.name)
        self._events.append(f'reached {stop.name}')
        self._leg.distance_left = 0.0
        if stop.wait_s > 0.0:
            self._state = MissionState.WAITING
            self._leg.wait_until = stamp + nanoseconds(stop.wait_s)
        else:
            self._next()

    def _miss(self, reason: str) -> None:
        name = self._tour[self._index].name
        self._missed.append((name, reason))
        self._events.append(f'missed {name}: {reason}')
        self._next()

    def _next(self) -> None:
        self._leave_stop()
        self._index += 1
        if self._index >= len(self._tour):
            self._end(MissionState.FAILED if self._missed else MissionState.DONE, '')
        else:
            self._state = MissionState.PLANNING

    def _leave_stop(self) -> None:
        """Forget what concerned one stop only."""
        self._leg = _Leg(replan_at=self.config.replan_after)
        self._progress.restart()

    def _end(self, state: MissionState, reason: str) -> None:
        waiting = self._state is MissionState.WAITING  # it stands where it was to go
        first = self._index + (1 if waiting else 0)
        self._missed.extend((stop.name, reason) for stop in self._tour[first:])
        self._state = state
        self._leg.path = None
        done = f'{len(self._reached)} of {len(self._tour)} stops reached'
        missed = '; '.join(f'{name}: {why}' for name, why in self._missed)
        self._message = f'{done}; missed {missed}' if missed else done
        self._events.append(f'{state.value}: {self._message}')
