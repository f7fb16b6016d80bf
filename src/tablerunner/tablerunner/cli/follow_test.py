"""`tablerunner follow-test`: following a person, judged over many seeds."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from tablerunner.cli.exits import FAILED


def follow_test(
    seeds: Annotated[int, typer.Option(metavar='N', min=1, help='How many seeds to run.')] = 10,
    first_seed: Annotated[
        int, typer.Option('--seed', metavar='N', min=0, help='The first of the seeds.')
    ] = 0,
    seconds: Annotated[
        float, typer.Option(metavar='S', min=20.0, help='How long each drive lasts.')
    ] = 60.0,
    output: Annotated[
        Path,
        typer.Option('-o', '--output', metavar='DIR', help='Folder of the picture and the JSON.'),
    ] = Path('out/follow-test'),
    json_file: Annotated[
        Optional[Path],
        typer.Option(
            '--json', metavar='FILE', help='Write the figures alone to a file: medians, 5-95 %.'
        ),
    ] = None,
) -> None:
    """Follow a person in simulated rooms: distance kept, touches, lost and found, given up.

    Writes follow_person.png and follow_person.json. Exit code 1 when a figure is out of its bound.

    Example: tablerunner follow-test --seeds 4 --seed 100
    """
    from rich.console import Console

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.reproduce import table_of
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.experiments.follow_person import run_follow_person

    with Bar('follow-test') as bar:
        outcome = run_follow_person(range(first_seed, first_seed + seeds), bar.show, seconds)
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    console.print(table_of(outcome))
    for note in outcome.notes:
        console.print(f'- {note}', markup=False)
    write_json(output / f'{outcome.name}.json', outcome.as_json())
    write_sheet(outcome.draw, output / f'{outcome.name}.png')
    if json_file is not None:
        write_json(json_file, outcome.as_figures())
    typer.echo(f'written: {output / outcome.name}.png, {output / outcome.name}.json')
    if not outcome.holds:
        raise typer.Exit(FAILED)
