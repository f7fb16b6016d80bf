"""`tablerunner drive-test`: deliveries in many random rooms, by the whole robot."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from tablerunner.cli.exits import FAILED

if TYPE_CHECKING:
    from rich.table import Table

    from tablerunner.experiments.drive_room import RoomDrive
    from tablerunner.experiments.drive_test import DriveTest
    from tablerunner.experiments.random_room import DriveRoom


def drive_test(
    rooms: Annotated[int, typer.Option(metavar='N', min=1, help='How many rooms.')] = 200,
    first_seed: Annotated[
        int, typer.Option('--first-seed', '--seed', metavar='K', min=0, help='The first seed.')
    ] = 0,
    controller: Annotated[
        str, typer.Option(metavar='C', help='fuzzy, pure_pursuit, or all: both, compared.')
    ] = 'fuzzy',
    room: Annotated[
        Optional[int],
        typer.Option('--room', metavar='SEED', min=0, help='Drive one room and draw it.'),
    ] = None,
    replay: Annotated[
        Optional[Path],
        typer.Option(metavar='FILE', help='Drive a saved room, room-SEED.yaml, and draw it.'),
    ] = None,
    output: Annotated[
        Path,
        typer.Option('-o', '--out', metavar='DIR', help='Folder of pictures, rooms and JSON.'),
    ] = Path('out/drive_test'),
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write the JSON here instead.')
    ] = None,
    jobs: Annotated[
        Optional[int], typer.Option(metavar='J', min=1, help='Processes; all cores if not given.')
    ] = None,
) -> None:
    """Drive deliveries in random rooms: simulator, ranging, ekf, mission, controller, safety stop.

    Rooms have walls with doors, tables, up to ten people and things that are not on the map; some
    tables cannot be reached. Asked is that the robot runs into nothing, reaches at least 99 % of
    the tables that can be reached, tells why it missed the others, and never drives endlessly.
    Rooms in which something goes wrong are saved. Exit code 1: a bound was missed.

    Example: tablerunner drive-test --rooms 40 --controller all
    """
    from rich.console import Console

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.control import CONTROLLERS
    from tablerunner.errors import ConfigError
    from tablerunner.experiments.drive_record import load_room
    from tablerunner.experiments.drive_test import run_drive_test
    from tablerunner.experiments.random_room import make_drive_room

    names = CONTROLLERS if controller == 'all' else (controller,)
    if room is not None and replay is not None:
        raise ConfigError('--replay', str(replay), 'one of --room and --replay')
    if room is not None or replay is not None:
        one = load_room(replay) if replay is not None else make_drive_room(room or 0)
        _drive_one(one, names, output)
        return
    with Bar('drive-test') as bar:
        test = run_drive_test(range(first_seed, first_seed + rooms), names, bar.show, jobs)
    console = Console(highlight=False, width=None if Console().is_terminal else 140)
    console.print(table_of(test, rooms, first_seed))
    for drive in test.failed:
        console.print(f'room {drive.seed}, {drive.controller}: ' + '; '.join(drive.faults))
    written = [json_file or output / 'drive_test.json']
    write_json(written[0], test.as_json())
    written += save_failed(test, output)
    typer.echo('written: ' + ', '.join(str(file) for file in written))
    if not test.holds:
        raise typer.Exit(FAILED)


def save_failed(test: 'DriveTest', folder: Path) -> list[Path]:
    """Save the rooms in which something went wrong; return their files."""
    from tablerunner.experiments.drive_record import save_room
    from tablerunner.experiments.random_room import make_drive_room

    files = []
    for seed in sorted({drive.seed for drive in test.failed}):
        drives = [drive for drive in test.failed if drive.seed == seed]
        files.append(save_room(folder, make_drive_room(seed), drives))
    return files


def _drive_one(room: 'DriveRoom', names: tuple[str, ...], folder: Path) -> None:
    """Drive one room, tell what happens, and draw it."""
    from tablerunner.control import CONTROLLERS
    from tablerunner.errors import ConfigError
    from tablerunner.experiments.drive_room import drive_room

    unknown = [name for name in names if name not in CONTROLLERS]
    if unknown:
        raise ConfigError('--controller', unknown[0], 'one of ' + ', '.join((*CONTROLLERS, 'all')))
    wrong = False
    for name in names:
        drive = drive_room(room, name)
        for time_s, event in drive.events:
            typer.echo(f'{time_s:7.1f} s  {event}')
        for contact in drive.contacts:
            who = 'hit' if contact.robot_at_fault else 'was touched by'
            typer.echo(f'{contact.stamp / 1e9 - 1.0:7.1f} s  {who} {contact.name}')
        verdict = '; '.join(drive.faults) or 'nothing went wrong'
        typer.echo(f'room {room.seed} ({room.kind}), {name}: {verdict}')
        file = folder / f'room-{room.seed}-{name}.png'
        draw(room, drive, file)
        typer.echo(f'written: {file}')
        wrong = wrong or bool(drive.faults)
    if wrong:
        raise typer.Exit(FAILED)


def draw(room: 'DriveRoom', drive: 'RoomDrive', file: Path) -> None:
    """Draw a tour into a PNG file."""
    from functools import partial

    from tablerunner.evaluation.plots.sheet import write_sheet

    width, depth = room.scenario.bounds[2:]
    high = 6.5 * depth / width + 0.8
    write_sheet(partial(_draw, room=room, drive=drive), file, (7.0, min(max(high, 4.0), 10.0)))


def _draw(figure: object, room: 'DriveRoom', drive: 'RoomDrive') -> None:
    import numpy as np

    from tablerunner.evaluation.plots.drive import draw_drive

    axes = figure.subplots()  # type: ignore[attr-defined]
    draw_drive(
        axes,
        room.scenario,
        room.unknown,
        drive.track,
        np.cumsum([leg.time_s for leg in drive.legs]).tolist(),
        {leg.stop: leg.is_open for leg in drive.legs},
        [(contact.stamp / 1e9 - 1.0, contact.robot_at_fault) for contact in drive.contacts],
    )
    axes.set_title(f'Room {room.seed} ({room.kind}), {drive.controller}', loc='left')


def table_of(test: 'DriveTest', rooms: int, first_seed: int) -> 'Table':
    """Return the table of a drive test for a terminal."""
    from rich import box
    from rich.table import Table

    table = Table(
        title=f'drive-test; {rooms} rooms from {first_seed}',
        title_justify='left',
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    headings = ('', 'mean', 'median', '5 %', '95 %', 'least', 'largest', 'of', 'asked', '')
    for index, heading in enumerate(headings):
        table.add_column(heading, justify='right' if index else 'left', no_wrap=True)
    for row in test.rows():
        spread = row.measured
        figures = (spread.mean, spread.median, spread.p5, spread.p95, spread.low, spread.high)
        asked = '' if row.bound is None else str(row.bound)
        verdict = '' if row.bound is None else 'kept' if row.holds else 'MISSED'
        table.add_row(
            row.name if row.unit == '1' else f'{row.name} [{row.unit}]',
            *(f'{figure:.3g}' for figure in figures),
            str(spread.count),
            asked,
            verdict,
        )
    return table
