"""`tablerunner reproduce`: a published experiment done again."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tablerunner.cli.exits import FAILED

if TYPE_CHECKING:
    from rich.table import Table

    from tablerunner.experiments.experiment import Outcome


def reproduce(
    name: Annotated[
        str, typer.Argument(metavar='NAME', help='Which experiment; without it they are listed.')
    ] = '',
    seeds: Annotated[
        int, typer.Option(metavar='N', min=1, help='How many seeds to run, from 0 on.')
    ] = 20,
    output: Annotated[
        Path,
        typer.Option('-o', '--output', metavar='DIR', help='Folder of the picture and the JSON.'),
    ] = Path('out/reproduce'),
) -> None:
    """Do a published experiment again: the paper's figures beside ours, raw rows first.

    Writes NAME.png and NAME.json. Exit code 1 when a figure is out of its bound.

    Example: tablerunner reproduce lv --seeds 20
    """
    from rich.console import Console

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.experiments.registry import EXPERIMENTS, experiment_named

    if not name:
        for known in EXPERIMENTS:
            typer.echo(known)
        return
    run = experiment_named(name)
    with Bar(f'reproduce {name}') as bar:
        outcome = run(range(seeds), bar.show)
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    console.print(table_of(outcome))
    for note in outcome.notes:
        console.print(f'- {note}', markup=False)
    write_json(output / f'{name}.json', outcome.as_json())
    write_sheet(outcome.draw, output / f'{name}.png')
    typer.echo(f'written: {output / name}.png, {output / name}.json')
    if not outcome.holds:
        raise typer.Exit(FAILED)


def table_of(outcome: 'Outcome') -> 'Table':
    """Return the table of an outcome for a terminal."""
    from rich import box
    from rich.table import Table

    table = Table(
        title=f'{outcome.title}\n{len(outcome.seeds)} seeds from {outcome.seeds[0]}',
        title_justify='left',
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for heading in ('', 'paper', 'mean +- std', 'median', 'min .. max', 'asked', ''):
        table.add_column(heading, justify='right' if heading else 'left', no_wrap=True)
    for index, row in enumerate(outcome.rows):
        measured = row.measured
        last_raw = row.raw and not any(later.raw for later in outcome.rows[index + 1 :])
        table.add_row(
            f'{row.name} [{row.unit}]'.replace('[', r'\[') + (' (raw)' if row.raw else ''),
            '' if row.paper is None else f'{row.paper:g}',
            f'{_figure(measured.mean)} +- {measured.std:.2g}',
            _figure(measured.median),
            f'{_figure(measured.low)} .. {_figure(measured.high)}',
            '' if row.bound is None else str(row.bound),
            '' if row.bound is None else 'holds' if row.holds else 'MISSED',
            end_section=last_raw,
        )
    return table


def _figure(value: float) -> str:
    return f'{value:.0f}' if abs(value) >= 1000.0 else f'{value:.3g}'
