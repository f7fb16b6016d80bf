"""`tablerunner convert`: recordings of others as bags of contract topics."""

from pathlib import Path
from typing import Annotated

import typer

convert_app = typer.Typer(
    help='Make a bag of contract topics from a recording of another kind.', no_args_is_help=True
)


@convert_app.callback()
def convert() -> None:
    """Make a bag of contract topics from a recording of another kind."""


@convert_app.command()
def labyrinth(
    source: Annotated[
        Path, typer.Argument(metavar='SRC', help='Folder with the text files of the recording.')
    ],
    target: Annotated[
        Path, typer.Argument(metavar='DST', help='Folder of the bag; must not exist.')
    ],
    storage: Annotated[
        str, typer.Option('--format', metavar='FORMAT', help='mcap or sqlite3.')
    ] = 'mcap',
) -> None:
    """Convert the labyrinth recording of TU Chemnitz (wheels, UWB ranges, true position).

    Beside the bag's own files a scenario.yaml is written, which replay finds by itself.

    Example: tablerunner convert labyrinth ../shared/data/labyrinth_tuc out/labyrinth
    """
    from tablerunner.bags.labyrinth import convert_labyrinth
    from tablerunner.types import seconds

    data = convert_labyrinth(source, target, storage)
    span = seconds(data.speeds[-1].stamp - data.speeds[0].stamp)
    typer.echo(
        f'{target}: {span:.1f} s, {len(data.ranges)} ranges of {len(data.anchors)} anchors, '
        f'{len(data.speeds)} wheel samples, {len(data.truth)} true positions'
    )
