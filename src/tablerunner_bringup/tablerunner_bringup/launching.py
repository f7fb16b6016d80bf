"""`tablerunner launch`: the whole robot, and deliveries if any are asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tablerunner.cli.console import Progress
from tablerunner.cli.exits import DONE, FAILED
from tablerunner.scenario import Scenario, load_scenario
from tablerunner_bringup.child import Ending
from tablerunner_bringup.delivery import Delivery, Outcome, activity
from tablerunner_bringup.executables import find_share
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.monitor import Monitor
from tablerunner_bringup.run_folder import RunFolder
from tablerunner_bringup.run_options import RunOptions
from tablerunner_bringup.session import (
    InterruptedRunError,
    NodeEndedError,
    NotUpError,
    Session,
    SessionSettings,
)
from tablerunner_bringup.team_service import TeamService

_SERVER_LIMIT_S = 20.0
_GIVE_UP_S = 5.0


@dataclass(frozen=True)
class Limits:
    """How long a delivery may take, in measurement time and by the wall clock [s]."""

    measured_s: float = math.inf
    wall_s: float = math.inf


@dataclass(frozen=True)
class LaunchOptions:
    """What `tablerunner launch` was asked for."""

    run: RunOptions = field(default_factory=RunOptions)
    session: SessionSettings = field(default_factory=SessionSettings)
    deliver: tuple[str, ...] = ()
    wait_s: float = 3.0
    return_home: bool = True
    output: Path | None = None


def default_scenario(name: str = 'restaurant') -> Path:
    """Return the file of a scenario among the installed share files."""
    return find_share('tablerunner_bringup') / 'scenarios' / f'{name}.yaml'


def launch(options: LaunchOptions, progress: Progress) -> int:
    """Run until the deliveries are done, or until Ctrl-C when there are none; return exit code.

    Raises
    ------
    ConfigError
        The scenario cannot be used, or it has no such stop: before anything is started.
    ExecutableError, DomainError
        The environment is not complete.
    """
    run, scenario = scenario_of(options.run)
    scenario.team(run.robots)
    for stop in options.deliver:
        scenario.stop_pose(stop)
    folder = (
        RunFolder.new(Path('out') / 'runs', scenario.name)
        if options.output is None
        else RunFolder(options.output)
    ).prepare(run.scenario_path)
    with Interrupts() as interrupts, progress:
        session = Session(scenario, run, folder, progress, interrupts, options.session)
        try:
            with session:
                code = _drive(session, options, progress)
        except NodeEndedError as error:
            tell_ending(error.ending, progress)
            code = FAILED
        except NotUpError as error:
            progress.say(str(error), 'red')
            code = FAILED
        except InterruptedRunError:
            code = FAILED
        if interrupts.asked:
            progress.say(f'ended by {interrupts.name}')
        progress.say(f'logs, parameters and what was recorded: {folder.path}')
    return code


def _drive(session: Session, options: LaunchOptions, progress: Progress) -> int:
    if not options.deliver:
        progress.say('everything is up; Ctrl-C ends it')
        session.wait(lambda: False, lambda: situation(session))
        return DONE
    if options.run.robots:
        return deliver_all(session, options, progress)
    outcome = deliver(session, options.deliver, options.wait_s, options.return_home, progress)
    return DONE if outcome is not None and outcome.success else FAILED


def deliver_all(session: Session, options: LaunchOptions, progress: Progress) -> int:
    """Share the stops out among the robots in turn, drive all at once, and return exit code."""
    service = TeamService(session, options.deliver, options.wait_s, options.return_home, progress)
    try:
        begun = time.monotonic()
        session.wait(
            lambda: service.is_ready or time.monotonic() - begun > _SERVER_LIMIT_S,
            lambda: 'waiting for the deliver actions',
        )
        if not service.is_ready:
            progress.say('not every robot offers the deliver action', 'red')
            return FAILED
        service.send()
        if not session.wait(service.is_done, lambda: situation(session)):
            service.cancel()
        return DONE if service.success else FAILED
    finally:
        service.close()


def deliver(
    session: Session,
    stops: tuple[str, ...],
    wait_s: float,
    return_home: bool,
    progress: Progress,
    limits: Limits | None = None,
    meanwhile: Callable[[Any], str] | None = None,
) -> Outcome | None:
    """Send a delivery and follow it to its end; None when the run was asked to end meanwhile.

    Beyond its limits it counts as failed and is cancelled. `meanwhile` is called again and again
    with the newest feedback; what it returns is said.
    """
    delivery = Delivery(session.node('tablerunner_delivery'), stops, wait_s, return_home)
    try:
        begun = time.monotonic()
        session.wait(
            lambda: delivery.is_ready or time.monotonic() - begun > _SERVER_LIMIT_S,
            lambda: 'waiting for the deliver action',
        )
        if not delivery.is_ready:
            return Outcome(False, 'nobody offers the deliver action')
        delivery.send()
        progress.say('delivery to ' + ', '.join(stops))
        follower = _Follower(session, delivery, progress, limits or Limits(), meanwhile)
        if not session.wait(follower.is_done, follower.words):
            delivery.cancel()
            return None
        outcome = delivery.outcome or Outcome(False, 'the delivery took too long')
        if delivery.outcome is None:
            delivery.cancel()
            end = time.monotonic() + _GIVE_UP_S
            while delivery.outcome is None and time.monotonic() < end:
                session.tick()
                delivery.spin(0.02)
        for stop, reason in outcome.missed:
            progress.say(f'{stop} was missed: {reason}', 'red')
        progress.say(outcome.message, 'green' if outcome.success else 'red')
        return outcome
    finally:
        delivery.close()


class _Follower:
    """Spins a delivery along with a session and says when its state changes."""

    def __init__(
        self,
        session: Session,
        delivery: Delivery,
        progress: Progress,
        limits: Limits,
        meanwhile: Callable[[Any], str] | None,
    ) -> None:
        self._session = session
        self._delivery = delivery
        self._progress = progress
        self._limits = limits
        self._meanwhile = meanwhile
        self._begun = elapsed_s(session)
        self._begun_wall = time.monotonic()
        self._said = ('', '')
        self._touches = len(session.monitor.touches)

    def is_done(self) -> bool:
        """Handle what has come; return whether the delivery ended or its time is up."""
        self._delivery.spin(0.0)
        self._tell()
        words = '' if self._meanwhile is None else self._meanwhile(self._delivery.feedback)
        if words:
            self._progress.say(f'{elapsed_s(self._session):6.1f} s  {words}')
        return (
            self._delivery.outcome is not None
            or elapsed_s(self._session) - self._begun > self._limits.measured_s
            or time.monotonic() - self._begun_wall > self._limits.wall_s
        )

    def words(self) -> str:
        """Return one line on where the robot is and what it does."""
        feedback = self._delivery.feedback
        if feedback is None:
            return situation(self._session)
        return f'{situation(self._session)}  {activity(feedback)}'

    def _tell(self) -> None:
        feedback = self._delivery.feedback
        if feedback is not None and (feedback.state, feedback.stop) != self._said:
            self._said = (feedback.state, feedback.stop)
            self._progress.say(f'{elapsed_s(self._session):6.1f} s  {activity(feedback)}')
        for touch in self._session.monitor.touches[self._touches :]:
            self._progress.say(f'{elapsed_s(self._session):6.1f} s  {touch.words}', 'red')
        self._touches = len(self._session.monitor.touches)


def elapsed_s(session: Session) -> float:
    """Return measurement time since the session was up; real time before the robot is known."""
    base = next(iter(session.robots.values())).base
    return session.seconds_since_up(None if base is None else base.stamp)


def situation(session: Session) -> str:
    """Return in one line where each robot is, how fast, and how far off it believes to be."""
    return f'{elapsed_s(session):6.1f} s' + ''.join(
        (f'  {name}' if name else '') + _place(monitor) for name, monitor in session.robots.items()
    )


def _place(monitor: Monitor) -> str:
    estimate, base = monitor.estimate, monitor.base
    if estimate is None:
        text = '  where the robot is is not known yet'
    else:
        pose = estimate.pose
        text = f'  at {pose.x:5.2f} {pose.y:5.2f} m {math.degrees(pose.heading):4.0f} deg'
    if base is not None:
        text += f'  {base.linear_m_s:4.2f} m/s'
    if not math.isnan(monitor.error_m):
        text += f'  off by {100 * monitor.error_m:3.0f} cm'
    return text


def tell_ending(ending: Ending, progress: Progress) -> None:
    """Say which process ended, how, and what it said last."""
    progress.say(f'{ending.name} {ending.how}; its log is {ending.log}', 'red')
    for line in ending.last_lines():
        progress.say(f'    {line}')


def scenario_of(run: RunOptions, default: str = 'restaurant') -> tuple[RunOptions, Scenario]:
    """Return options with the scenario's path filled in, and the scenario.

    Several robots have a scenario of their own where none is given.
    """
    if not run.scenario:
        default = 'brasserie' if run.robots else default
        run = run.replace(scenario=str(default_scenario(default)))
    return run, load_scenario(run.scenario_path)
