"""`tablerunner reproduce`: a published experiment done again."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from tablerunner.cli.exits import FAILED

if TYPE_CHECKING:
    from rich.table import Table

    from tablerunner.experiments.experiment import Outcome, Row


def reproduce(
    name: Annotated[
        str, typer.Argument(metavar='NAME', help='Which experiment; without it they are listed.')
    ] = '',
    seeds: Annotated[
        Optional[int],
        typer.Option(
            metavar='N',
            min=1,
            help='How many seeds to run; 20, of pf_uiekf and camera_start 100, of crossings 4.',
        ),
    ] = None,
    first_seed: Annotated[
        int, typer.Option('--seed', metavar='N', min=0, help='The first of the seeds.')
    ] = 0,
    output: Annotated[
        Path,
        typer.Option('-o', '--output', metavar='DIR', help='Folder of the picture and the JSON.'),
    ] = Path('out/reproduce'),
    json_file: Annotated[
        Optional[Path],
        typer.Option(
            '--json', metavar='FILE', help='Write the figures alone to a file: medians, 5-95 %.'
        ),
    ] = None,
    data: Annotated[
        Path,
        typer.Option(
            metavar='DIR', envvar='TABLERUNNER_DATA', help='Folder with recordings of others.'
        ),
    ] = Path('../shared/data'),
) -> None:
    """Do a published experiment again: the paper's figures beside ours, raw rows first.

    Writes NAME.png and NAME.json. Exit code 1 when a figure is out of its bound.

    Example: tablerunner reproduce lv --seeds 20 --seed 100
    """
    from rich.console import Console

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.experiments.registry import (
        EXPERIMENTS,
        OTHER_SEEDS,
        RECORDED,
        USUAL_SEEDS,
        require_experiment,
    )

    if not name:
        for known in (*EXPERIMENTS, *RECORDED):
            typer.echo(known)
        return
    require_experiment(name)
    with Bar(f'reproduce {name}') as bar:
        if name in RECORDED:
            outcome = RECORDED[name](data, bar.show)
        else:
            count = seeds or OTHER_SEEDS.get(name, USUAL_SEEDS)
            outcome = EXPERIMENTS[name](range(first_seed, first_seed + count), bar.show)
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    console.print(table_of(outcome))
    for note in outcome.notes:
        console.print(f'- {note}', markup=False)
    write_json(output / f'{name}.json', outcome.as_json())
    write_sheet(outcome.draw, output / f'{name}.png')
    if json_file is not None:
        write_json(json_file, outcome.as_figures())
    typer.echo(f'written: {output / name}.png, {output / name}.json')
    if not outcome.holds:
        raise typer.Exit(FAILED)


def table_of(outcome: 'Outcome') -> 'Table':
    """Return the table of an outcome for a terminal; a recording's single run has no spread."""
    from rich import box
    from rich.table import Table

    single = all(row.measured.count == 1 for row in outcome.rows)
    runs = 'one run' if single else f'{len(outcome.seeds)} seeds from {outcome.seeds[0]}'
    table = Table(
        title=f'{outcome.title}; {runs}',
        title_justify='left',
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    published = any(row.paper is not None for row in outcome.rows)
    spread = () if single else ('median', 'min .. max')
    headings = (
        '',
        *(('paper',) if published else ()),
        'measured' if single else 'mean +- std',
        *spread,
        'asked',
        '',
    )
    for index, heading in enumerate(headings):
        # Names may take a second line: a figure or a verdict that is cut off says nothing.
        table.add_column(heading, justify='right' if heading else 'left', no_wrap=index > 0)
    for index, row in enumerate(outcome.rows):
        cells = _cells(row)
        if single:
            cells = [*cells[:2], _figure(row.measured.mean), *cells[5:]]
        if not published:
            cells = [cells[0], *cells[2:]]
        last_raw = row.raw and not any(later.raw for later in outcome.rows[index + 1 :])
        table.add_row(*cells, end_section=last_raw)
    return table


def _cells(row: 'Row') -> list[str]:
    measured = row.measured
    name = f'{row.name} [{row.unit}]'.replace('[', r'\[')
    return [
        name + (' (raw)' if row.raw else ''),
        '' if row.paper is None else f'{row.paper:g}',
        f'{_figure(measured.mean)} +- {measured.std:.2g}',
        _figure(measured.median),
        f'{_figure(measured.low)} .. {_figure(measured.high)}',
        '' if row.bound is None else str(row.bound),
        '' if row.bound is None else 'holds' if row.holds else 'MISSED',
    ]


def _figure(value: float) -> str:
    return f'{value:.0f}' if abs(value) >= 1000.0 else f'{value:.3g}'
