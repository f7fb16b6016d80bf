"""The command `tablerunner`: its own commands and those of the entry-point group."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer

from tablerunner.cli.calibrate import calibrate_app
from tablerunner.cli.compare import compare
from tablerunner.cli.convert import convert_app
from tablerunner.cli.drive_test import drive_test
from tablerunner.cli.exits import BAD_INPUT, DONE, FAILED
from tablerunner.cli.explain_rule import explain_rule
from tablerunner.cli.follow_test import follow_test
from tablerunner.cli.info import info
from tablerunner.cli.plot import plot
from tablerunner.cli.replay import replay
from tablerunner.cli.reproduce import reproduce
from tablerunner.cli.stop_test import stop_test
from tablerunner.cli.survey_anchors import survey_anchors
from tablerunner.cli.tune import tune
from tablerunner.errors import BagError, ConfigError, TablerunnerError

GROUP = 'tablerunner.commands'
"""Entry-point group by which other packages add commands: functions, or typer apps."""


def make_app() -> typer.Typer:
    """Return the command with all its commands."""
    app = typer.Typer(
        name='tablerunner',
        help='Navigation of an indoor delivery robot: run it, record it, replay it.\n\n'
        'Exit codes: 0 done, 1 the job failed, 2 bad input.',
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={'help_option_names': ['-h', '--help']},
    )
    app.command()(replay)
    app.command()(info)
    app.command()(plot)
    app.command()(tune)
    app.command()(reproduce)
    app.command()(compare)
    app.command()(drive_test)
    app.command()(stop_test)
    app.command()(explain_rule)
    app.command()(follow_test)
    app.command()(survey_anchors)
    app.add_typer(convert_app, name='convert')
    app.add_typer(calibrate_app, name='calibrate')
    for entry in sorted(entry_points(group=GROUP), key=lambda item: item.name):
        _add(app, entry)
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process when not given.
    """
    try:
        make_app()(args=None if arguments is None else list(arguments), prog_name='tablerunner')
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else DONE if end.code is None else FAILED
    except TablerunnerError as error:
        sys.stderr.write(f'tablerunner: {error}\n')
        return BAD_INPUT if isinstance(error, (BagError, ConfigError)) else FAILED
    return DONE


def _add(app: typer.Typer, entry: EntryPoint) -> None:
    try:
        command: Any = entry.load()
    except (ImportError, AttributeError) as error:
        command = _broken(entry.name, str(error))
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=entry.name)
    else:
        app.command(entry.name)(command)


def _broken(name: str, reason: str) -> Any:
    """Return a stand-in for a command that cannot be loaded, so that the others still work."""

    def command() -> None:
        raise ConfigError(
            name, reason, 'ROS 2 and the built workspace: source ./env.sh, or run make setup'
        )

    command.__doc__ = f'Not available here: {reason}.'
    return command


if __name__ == '__main__':
    sys.exit(main())
