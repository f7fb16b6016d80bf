"""`tablerunner demo`: meals go to tables, something is always in the way, and all is judged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tablerunner.bags.reader import BagReader
from tablerunner.cli.console import Progress
from tablerunner.cli.exits import DONE, FAILED
from tablerunner.errors import TablerunnerError
from tablerunner.scenario import Scenario
from tablerunner_bringup.checks import Check, checks_of, failures
from tablerunner_bringup.delivery import Outcome
from tablerunner_bringup.emergency_drill import DrillReport, EmergencyDrill
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.judgement import judge
from tablerunner_bringup.launching import Limits, deliver, scenario_of, tell_ending
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

SCENARIO, TABLES = 'evening', ('table_5', 'table_6')
"""What is shown when nothing else is asked for."""


@dataclass(frozen=True)
class DemoOptions:
    """What the demo is to show.

    Without tables: `TABLES` in its own scenario, the first two of another.
    """

    run: RunOptions = field(default_factory=RunOptions)
    tables: tuple[str, ...] = ()
    wait_s: float = 3.0
    limit_s: float = 300.0  # measurement time
    wall_limit_s: float = 600.0
    output: Path = Path('out') / 'demo'
    domain: int | None = None


@dataclass(frozen=True)
class Trip:
    """What happened on the way."""

    tables: tuple[str, ...]
    outcome: Outcome | None
    touches: tuple[Touch, ...]
    drill: DrillReport = field(default_factory=DrillReport)

    def facts(
        self, seed: int, failed: Sequence[str], checks: Sequence[Check] = ()
    ) -> dict[str, Any]:
        """Return what errors.json says beside the errors."""
        return {
            'delivered': not self.failures,
            'failures': list(failed),
            'tables': list(self.tables),
            'seed': seed,
            'reached': [] if self.outcome is None else list(self.outcome.reached),
            'checks': {check.name: check.as_json() for check in checks},
            'contacts': [
                {'what': touch.words, 'robot_at_fault': touch.robot_at_fault}
                for touch in self.touches
            ],
        }

    @property
    def failures(self) -> tuple[str, ...]:
        """Return in words why the meals were not delivered well; empty when they were."""
        failed = []
        if self.outcome is None:
            failed.append('it was ended before the robot was back')
        elif not self.outcome.success:
            failed.append(self.outcome.message)
        failed += [touch.words for touch in self.touches if touch.robot_at_fault]
        return tuple(failed)


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
    own = not options.run.scenario
    run, scenario = scenario_of(options.run, SCENARIO)
    tables = options.tables or (TABLES if own else tuple(t.name for t in scenario.tables[:2]))
    for table in tables:
        scenario.stop_pose(table)
    folder = RunFolder(options.output)
    folder.clear()
    folder.prepare(run.scenario_path)
    with Interrupts() as interrupts, progress:
        progress.say(
            f'{scenario.name}: {len(scenario.tables)} tables, {len(scenario.people)} people, '
            f'{len(scenario.anchors)} anchors; meals for {", ".join(tables)}, seed {run.seed}'
        )
        for box in scenario.boxes:
            if box.unmapped:
                progress.say(f'  what the map does not know: {box.name}')
        settings = SessionSettings(record=True, domain=options.domain)
        session = Session(scenario, run, folder, progress, interrupts, settings)
        trip = _drive(session, tables, options, progress)
        if trip is None:
            return FAILED
        progress.show('judging the trip')
        failed = _judge(trip, folder, scenario, run.seed, progress)
        for failure in failed:
            progress.say(f'failed: {failure}', 'red')
        if not failed:
            progress.say('The meals have been delivered and the robot is back.', 'green')
        progress.say(f'{time.monotonic() - begun:.0f} s in all; results: {options.output}/')
    return FAILED if failed else DONE


def scenario_home(scenario: Scenario) -> str:
    """Return the name of the place where the robot starts."""
    return 'start' if scenario.kitchen is None else scenario.kitchen.name


def _judge(
    trip: Trip, folder: RunFolder, scenario: Scenario, seed: int, progress: Progress
) -> list[str]:
    """Judge what was recorded, tell it, and write it; return what failed."""
    failed = list(trip.failures)
    try:
        with BagReader(folder.bag) as bag:
            checks = checks_of(bag, scenario, trip.drill)
        failed += failures(checks)
        way = ' - '.join((scenario_home(scenario), *trip.tables))
        table = judge(
            folder.bag,
            scenario,
            f'{scenario.name}: {way} and back',
            trip.facts(seed, failed, checks),
            folder.errors,
            folder.picture,
        )
    except TablerunnerError as error:
        return [*failed, f'the trip cannot be judged: {error}']
    for check in checks:
        if check.passed:
            progress.say(f'{check.name}: {check.words}', 'green')
    _tell_errors(table, progress)
    return failed


def _drive(
    session: Session, tables: tuple[str, ...], options: DemoOptions, progress: Progress
) -> Trip | None:
    """Start everything, deliver, end everything; None when there is no trip to judge."""
    try:
        with session:
            drill = EmergencyDrill(session.monitor, tables[-1])
            outcome = deliver(
                session,
                tables,
                options.wait_s,
                return_home=True,
                progress=progress,
                limits=Limits(options.limit_s, options.wall_limit_s),
                meanwhile=drill.step,
            )
            return Trip(tables, outcome, tuple(session.monitor.touches), drill.report)
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
