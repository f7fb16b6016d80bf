"""`tablerunner stop-test`: how far the robot runs before it stands, against what is computed."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from tablerunner.cli.exits import FAILED


def stop_test(
    seeds: Annotated[int, typer.Option(metavar='N', min=1, help='How many seeds to run.')] = 20,
    first_seed: Annotated[
        int, typer.Option('--seed', metavar='N', min=0, help='The first of the seeds.')
    ] = 0,
    output: Annotated[
        Path, typer.Option('-o', '--output', metavar='DIR', help='Folder of the picture.')
    ] = Path('out/stop-test'),
    json_file: Annotated[
        Optional[Path],
        typer.Option('--json', metavar='FILE', help='Write the figures to a file.'),
    ] = None,
) -> None:
    """Measure in the simulator how the safety stop stops a robot that is told to go on.

    Emergency stop, silence, walls at angles, people who walk up to it. Writes stopping.png. Exit
    code 1 when the robot ran farther than computed, or touched something.

    Example: tablerunner stop-test --seeds 5 --json out/stop-test/figures.json
    """
    from rich.console import Console

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.reproduce import table_of
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.experiments.stopping import run_stopping

    with Bar('stop-test') as bar:
        outcome = run_stopping(range(first_seed, first_seed + seeds), bar.show)
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    console.print(table_of(outcome))
    for note in outcome.notes:
        console.print(f'- {note}', markup=False)
    write_sheet(outcome.draw, output / 'stopping.png')
    typer.echo(f'written: {output / "stopping.png"}')
    if json_file is not None:
        write_json(json_file, outcome.as_json())
    if not outcome.holds:
        raise typer.Exit(FAILED)
