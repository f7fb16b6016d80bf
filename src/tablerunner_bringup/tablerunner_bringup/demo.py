"""`tablerunner demo`: a meal goes to a table, the robot comes home, and the trip is judged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tablerunner.cli.console import Progress
from tablerunner.cli.exits import DONE, FAILED
from tablerunner.errors import TablerunnerError
from tablerunner.scenario import Scenario
from tablerunner_bringup.delivery import Outcome
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.judgement import judge
from tablerunner_bringup.launching import Limits, deliver, elapsed_s, scenario_of, tell_ending
from tablerunner_bringup.monitor import Touch
from tablerunner_bringup.run_folder import RunFolder
from tablerunner_bringup.run_options import RunOptions
from tablerunner_bringup.session import (
    InterruptedRunError,
    NodeEndedError,
    NotUpError,
    Session,
    SessionSettings,
)


@dataclass(frozen=True)
class DemoOptions:
    """What the demo is to show."""

    run: RunOptions = field(default_factory=RunOptions)
    table: str = 'table_3'
    wait_s: float = 5.0
    limit_s: float = 240.0  # measurement time
    wall_limit_s: float = 600.0
    output: Path = Path('out') / 'demo'
    domain: int | None = None


@dataclass(frozen=True)
class Trip:
    """What happened on the way."""

    table: str
    outcome: Outcome | None
    touches: tuple[Touch, ...]
    duration_s: float
    final_error_m: float

    def facts(self, seed: int, failures: Sequence[str]) -> dict[str, Any]:
        """Return what errors.json says beside the errors."""
        return {
            'delivered': not failures,
            'failures': list(failures),
            'table': self.table,
            'seed': seed,
            'reached': [] if self.outcome is None else list(self.outcome.reached),
            'contacts': [
                {'what': touch.words, 'robot_at_fault': touch.robot_at_fault}
                for touch in self.touches
            ],
        }

    @property
    def failures(self) -> tuple[str, ...]:
        """Return in words why the demo failed; empty when it did not."""
        failures = []
        if self.outcome is None:
            failures.append('it was ended before the robot was back')
        elif not self.outcome.success:
            failures.append(self.outcome.message)
        failures += [touch.words for touch in self.touches if touch.robot_at_fault]
        return tuple(failures)


def demo(options: DemoOptions, progress: Progress) -> int:
    """Run the demo and write bag, picture and errors; return the exit code.

    Raises
    ------
    ConfigError
        The scenario cannot be used, or it has no such table.
    ExecutableError, DomainError
        The environment is not complete.
    """
    begun = time.monotonic()
    run, scenario = scenario_of(options.run)
    scenario.stop_pose(options.table)
    folder = RunFolder(options.output)
    folder.clear()
    folder.prepare(run.scenario_path)
    with Interrupts() as interrupts, progress:
        progress.say(
            f'{scenario.name}: {len(scenario.tables)} tables, {len(scenario.people)} people, '
            f'{len(scenario.anchors)} anchors; a meal for {options.table}, seed {run.seed}'
        )
        settings = SessionSettings(record=True, domain=options.domain)
        session = Session(scenario, run, folder, progress, interrupts, settings)
        trip = _drive(session, options, progress)
        if trip is None:
            return FAILED
        progress.show('judging the trip')
        failures = list(trip.failures)
        try:
            table = judge(
                folder.bag,
                scenario,
                f'{scenario.name}: {scenario_home(scenario)} - {options.table} and back',
                trip.facts(run.seed, failures),
                folder.errors,
                folder.picture,
            )
            _tell_errors(table, progress)
        except TablerunnerError as error:
            failures.append(f'the trip cannot be judged: {error}')
        for failure in failures:
            progress.say(f'failed: {failure}', 'red')
        if not failures:
            progress.say('The meal has been delivered and the robot is back.', 'green')
        progress.say(f'{time.monotonic() - begun:.0f} s in all; results: {options.output}/')
    return FAILED if failures else DONE


def scenario_home(scenario: Scenario) -> str:
    """Return the name of the place where the robot starts."""
    return 'start' if scenario.kitchen is None else scenario.kitchen.name


def _drive(session: Session, options: DemoOptions, progress: Progress) -> Trip | None:
    """Start everything, deliver, end everything; None when there is no trip to judge."""
    try:
        with session:
            outcome = deliver(
                session,
                (options.table,),
                options.wait_s,
                return_home=True,
                progress=progress,
                limits=Limits(options.limit_s, options.wall_limit_s),
            )
            monitor = session.monitor
            return Trip(
                options.table,
                outcome,
                tuple(monitor.touches),
                elapsed_s(session),
                monitor.error_m,
            )
    except NodeEndedError as error:
        tell_ending(error.ending, progress)
    except (NotUpError, InterruptedRunError) as error:
        progress.say(str(error), 'red')
    return None


def _tell_errors(table: dict[str, Any], progress: Progress) -> None:
    for words, key in (('estimate', 'position_error'), ('UWB alone', 'uwb_only_error')):
        sizes = table[key]
        progress.say(
            f'{words}: RMSE {100 * sizes["rmse"]:.1f} cm, mean {100 * sizes["mean"]:.1f} cm, '
            f'largest {100 * sizes["max"]:.1f} cm ({sizes["compared"]} compared with the truth)'
        )
    progress.say(
        f'{table["nlos_ranges"]} of {table["ranges"]} ranges without line of sight; '
        f'{len(table["halts"])} halts for people and things'
    )
