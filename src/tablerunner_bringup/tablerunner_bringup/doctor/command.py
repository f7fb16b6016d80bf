"""The command `tablerunner doctor`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from tablerunner.cli.console import Progress
from tablerunner.cli.exits import DONE, FAILED
from tablerunner.cli.json_file import write_json
from tablerunner.errors import ConfigError

if TYPE_CHECKING:
    from tablerunner.doctor import Facts, Finding

_HOST_CHECKS = ('environment', 'serial')


def doctor(
    seconds: Annotated[
        float, typer.Option(min=0.5, max=600.0, help='How long to listen to the robot.')
    ] = 5.0,
    checks: Annotated[
        Optional[list[str]],
        typer.Option('--check', help='Only this check; may be given often. Default: all.'),
    ] = None,
    localization_only: Annotated[
        bool, typer.Option('--localization-only', help='Somebody else drives (Nav2).')
    ] = False,
    odom_topic: Annotated[
        str, typer.Option(help='Wheel odometry, where it is not odom.')
    ] = 'odom',
    ports: Annotated[
        Optional[list[str]],
        typer.Option('--port', help='Serial port that must work; may be given often.'),
    ] = None,
    namespace: Annotated[str, typer.Option(help='Namespace of the robot.')] = '',
    domain: Annotated[
        Optional[int], typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
    everything: Annotated[
        bool, typer.Option('--all/--faults', help='Show what is right, too, or faults only.')
    ] = True,
    json_file: Annotated[
        Optional[Path], typer.Option('--json', help='Write the findings to this file.')
    ] = None,
) -> None:
    """Say what is wrong with a robot and what to do; exit code 0 only when nothing is.

    Looks at programs, serial ports, DDS, nodes, topics and their rates, clocks, frames,
    parameters, anchors and what the nodes say. Before anything runs:
    --check environment --check serial.

    Example: tablerunner doctor --seconds 10 --json out/doctor.json
    """
    from tablerunner.doctor import CHECKS, Level, diagnose

    asked = tuple(checks or CHECKS)
    for name in asked:
        if name not in CHECKS:
            raise ConfigError('--check', name, f'one of {", ".join(CHECKS)}', 'options')
    with Progress() as progress:
        facts = _facts(
            asked, progress, seconds, localization_only, odom_topic, ports or [], namespace, domain
        )
    findings = diagnose(facts, asked)
    wrong = [item for item in findings if item.level is not Level.OK]
    for item in findings if everything else wrong:
        _tell(item)
    errors = sum(item.level is Level.ERROR for item in wrong)
    typer.echo(
        f'{len(findings)} findings: {errors} errors, {len(wrong) - errors} warnings'
        if wrong
        else f'{len(findings)} findings: nothing is wrong'
    )
    if json_file is not None:
        write_json(json_file, {'findings': [item.as_json() for item in findings]})
    raise typer.Exit(FAILED if wrong else DONE)


def _tell(item: 'Finding') -> None:
    typer.echo(f'{item.level.value:8}{item.check:12}{item.subject}: {item.words}')
    if item.advice:
        typer.echo(f'{"":20}-> {item.advice}')


def _facts(
    checks: tuple[str, ...],
    progress: Progress,
    seconds: float,
    localization_only: bool,
    odom_topic: str,
    ports: list[str],
    namespace: str,
    domain: Optional[int],
) -> 'Facts':
    """Gather what the checks need; without ROS only what the host tells."""
    from tablerunner.doctor import Facts
    from tablerunner_bringup.doctor.host import environment_facts, serial_facts

    progress.show('looking at this machine')
    environment = environment_facts()
    if set(checks) <= set(_HOST_CHECKS) or not environment.middleware:
        return Facts(environment, serial_facts(ports))
    from tablerunner_bringup.doctor.robot import robot_facts

    number = domain
    if number is None:
        text = environment.variables.get('ROS_DOMAIN_ID', '') or '0'
        number = int(text) if text.isdigit() else 0
    os.environ['ROS_DOMAIN_ID'] = str(number)
    facts = robot_facts(number, namespace, odom_topic, seconds, progress)
    told = [str(facts.parameter('uwb_driver', 'serial.port', ''))]
    return facts.with_host(environment, serial_facts([*ports, *told]), localization_only)
