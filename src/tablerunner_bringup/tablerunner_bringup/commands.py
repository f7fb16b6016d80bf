"""The commands that need ROS; the core's `tablerunner` command finds them by entry points."""

from __future__ import annotations

import datetime as dt
import sys
from pathlib import Path
from typing import Annotated

import typer

from tablerunner.errors import TablerunnerError
from tablerunner_bringup.console import Progress

DONE, FAILED, BAD_INPUT = 0, 1, 2


def record(
    output: Annotated[
        Path | None, typer.Option('-o', '--output', help='Folder of the bag; must not exist.')
    ] = None,
    storage: Annotated[
        str, typer.Option('--format', help='mcap or sqlite3.', metavar='FORMAT')
    ] = 'mcap',
    topics: Annotated[
        list[str] | None,
        typer.Option('--topics', help='Topic to record; * and ? allowed; may be given often.'),
    ] = None,
    everything: Annotated[
        bool, typer.Option('--all', help='Hidden topics too (those of actions).')
    ] = False,
    use_sim_time: Annotated[
        bool, typer.Option('--use-sim-time', help='Stamp with /clock instead of system time.')
    ] = False,
    duration: Annotated[
        float, typer.Option(min=0.0, help='End after so many seconds; 0: never.')
    ] = 0.0,
    domain: Annotated[
        int | None, typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
) -> None:
    """Record topics into a bag, with all message definitions, until Ctrl-C.

    Example: tablerunner record -o out/kitchen --topics '/uwb/*' --topics /odom
    """
    from tablerunner_bringup.recorder import Selection
    from tablerunner_bringup.recording import RecordOptions
    from tablerunner_bringup.recording import record as run

    stamp = dt.datetime.now().astimezone().strftime('%Y-%m-%d_%H-%M-%S')
    options = RecordOptions(
        output or Path('out') / f'bag_{stamp}',
        storage,
        Selection(tuple(map(_absolute, topics or ())), everything),
        use_sim_time,
        duration or float('inf'),
        domain,
    )
    progress = Progress()
    with _errors_as_exit_codes():
        written, losses = run(options, progress)
    for topic, count in sorted(losses.missed.items()):
        progress.say(f'{topic}: {count} messages did not arrive here', 'yellow')
    for topic, reason in sorted(losses.refused.items()):
        progress.say(f'{topic} was not recorded: {reason}', 'yellow')
    if losses.unstamped:
        progress.say(f'{losses.unstamped} messages came without a /clock: left out', 'yellow')
    typer.echo(f'{written} messages in {options.folder}')
    if not written:
        raise typer.Exit(FAILED)


def play(
    bag: Annotated[Path, typer.Argument(help='Folder of the bag, an .mcap or a .db3 file.')],
    rate: Annotated[float, typer.Option(help='Seconds of the bag per second.')] = 1.0,
    start: Annotated[float, typer.Option(min=0.0, help='Begin at this second.')] = 0.0,
    topics: Annotated[
        list[str] | None,
        typer.Option('--topics', help='Topic to play; * and ? allowed; may be given often.'),
    ] = None,
    remap: Annotated[
        list[str] | None, typer.Option('--remap', help='OLD:=NEW name of a topic.')
    ] = None,
    clock: Annotated[
        bool, typer.Option('--clock/--no-clock', help='Publish /clock by the times of the bag.')
    ] = True,
    loop: Annotated[bool, typer.Option('--loop', help='Begin again at the end.')] = False,
    wait_for: Annotated[
        list[str] | None,
        typer.Option('--wait-for', help='Topic that must have a subscriber before the start.'),
    ] = None,
    wait_limit: Annotated[
        float, typer.Option(min=0.0, help='Seconds to wait for them before giving up.')
    ] = 30.0,
    domain: Annotated[
        int | None, typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
) -> None:
    """Publish a bag with its own quality of service, in its order and at its pace.

    Example: tablerunner play out/demo/bag --topics '/uwb/*' --rate 2 --wait-for /uwb/ranges
    """
    from tablerunner_bringup.player import Pace
    from tablerunner_bringup.playing import PlayOptions
    from tablerunner_bringup.playing import play as run
    from tablerunner_bringup.recorder import Selection

    if not rate > 0.0:
        raise typer.BadParameter('expected a rate above 0', param_hint='--rate')
    options = PlayOptions(
        bag,
        Pace(rate, start, clock, dict(map(_renaming, remap or ()))),
        Selection(tuple(map(_absolute, topics or ())), hidden=True),
        tuple(map(_absolute, wait_for or ())),
        wait_limit,
        loop,
        domain,
    )
    with _errors_as_exit_codes():
        count = run(options, Progress())
    typer.echo(f'{count} messages of {bag}')


def _absolute(topic: str) -> str:
    return topic if topic.startswith('/') else f'/{topic}'


def _renaming(text: str) -> tuple[str, str]:
    old, found, new = text.partition(':=')
    if not (old and found and new):
        raise typer.BadParameter(f'{text!r}: expected OLD:=NEW', param_hint='--remap')
    return _absolute(old), _absolute(new)


class _errors_as_exit_codes:  # noqa: N801 - reads as a statement
    """Turn what Tablerunner raises on purpose into one line on stderr and an exit code."""

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        from tablerunner_bringup.player import PlayError

        if isinstance(error, TablerunnerError):
            sys.stderr.write(f'tablerunner: {error}\n')
            raise typer.Exit(FAILED if isinstance(error, PlayError) else BAD_INPUT) from error
