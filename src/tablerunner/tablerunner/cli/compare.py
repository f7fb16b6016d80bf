"""`tablerunner compare`: all estimators on the same simulated drives, beside the bound."""

from math import degrees, isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from tablerunner.evaluation.comparison import Comparison


def compare(
    scenario: Annotated[
        str, typer.Option(metavar='S', help='Scenario file, or the name of an installed one.')
    ],
    estimators: Annotated[
        str, typer.Option(metavar='E,E,...', help='Which estimators; empty for all.')
    ] = '',
    route: Annotated[
        str,
        typer.Option(metavar='NAME', help="Which of the scenario's routes; the first if empty."),
    ] = '',
    seeds: Annotated[int, typer.Option(metavar='N', min=1, help='How many seeds to run.')] = 20,
    first_seed: Annotated[
        int, typer.Option('--first-seed', '--seed', metavar='K', min=0, help='The first of them.')
    ] = 0,
    speed: Annotated[float, typer.Option(metavar='V', help='How fast to drive [m/s].')] = 0.5,
    nlos: Annotated[
        bool,
        typer.Option(help='As the scenario is; or without anything that could block a range.'),
    ] = True,
    defaults: Annotated[
        bool,
        typer.Option('--defaults', help='Noise and priors as shipped instead of matched.'),
    ] = False,
    output: Annotated[
        Path,
        typer.Option('-o', '--out', metavar='DIR', help='Folder of the pictures, CSV and JSON.'),
    ] = Path('out/compare'),
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write the JSON here instead.')
    ] = None,
    csv_file: Annotated[
        Optional[Path], typer.Option('--csv', metavar='FILE', help='Write the CSV here instead.')
    ] = None,
    workers: Annotated[
        Optional[int], typer.Option(metavar='W', min=1, help='Processes; all cores if not given.')
    ] = None,
) -> None:
    """Run estimators on the same simulated drives over many seeds, beside the Cramer-Rao bound.

    All begin at the same pose, drawn about the true one. Noise and priors are matched to the
    sensors of the scenario, so that what differs are the estimators. NEES and NIS are for each
    dimension (1 is right); "in %" is the share of the steps at which their average over the
    seeds lies in its two-sided 95 % bounds. Writes pictures, CSV (a line for each run) and JSON.

    Example: tablerunner compare --scenario hall --estimators ekf,ukf --seeds 60 --no-nlos
    """
    from rich.console import Console

    from tablerunner.bags.replay_config import ReplayConfig
    from tablerunner.cli.bar import Bar
    from tablerunner.cli.csv_file import write_csv
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.scenario_file import find_route, find_scenario_file
    from tablerunner.estimation.registry import ESTIMATORS
    from tablerunner.experiments.compare import Setup, clear_of, compared, run_compare
    from tablerunner.scenario import load_scenario

    room = load_scenario(find_scenario_file(scenario))
    points = find_route(room, route)
    names = tuple(name.strip() for name in estimators.split(',') if name.strip())
    room = room if nlos else clear_of(room)
    config = ReplayConfig.from_scenario(room) if defaults else None
    setup = Setup(room, points, names or tuple(ESTIMATORS), speed, config)
    with Bar(f'compare on {room.name}') as bar:
        runs = run_compare(setup, range(first_seed, first_seed + seeds), bar.show, workers)
    comparison = compared(setup, runs)
    console = Console(highlight=False, width=None if Console().is_terminal else 120)
    console.print(table_of(comparison))
    blocked = sum(run.blocked for run in runs) / len(runs)
    touched = sum(run.contacts for run in runs)
    sight = f'{100.0 * blocked:.1f} % of the ranges blocked' if blocked else 'all ranges clear'
    console.print(
        f'{sight}; noise and priors {"as shipped" if defaults else "matched to the sensors"}'
        + (f'; the robot touched something {touched} times' if touched else '')
    )
    figures = {
        'scenario': room.name,
        'speed': speed,
        'matched': not defaults,
        'blocked': blocked,
        'contacts': touched,
        **comparison.as_json(),
    }
    written = [json_file or output / 'compare.json', csv_file or output / 'compare.csv']
    write_json(written[0], figures)
    write_csv(written[1], comparison.rows())
    written += draw(comparison, output)
    typer.echo('written: ' + ', '.join(str(file) for file in written))


def draw(comparison: 'Comparison', folder: Path) -> list[Path]:
    """Write the pictures and return their files: one of all, one of each estimator."""
    from functools import partial

    from tablerunner.evaluation.plots.compare import draw_comparison, draw_estimator
    from tablerunner.evaluation.plots.sheet import write_sheet

    files = [folder / 'compare.png']
    write_sheet(partial(draw_comparison, comparison=comparison), files[0], (9.0, 6.0))
    for item in comparison.estimators:
        files.append(folder / f'{item.name}.png')
        one = partial(draw_estimator, comparison=comparison, item=item)
        write_sheet(one, files[-1], (9.0, 8.0))
    return files


def table_of(comparison: 'Comparison') -> 'Table':
    """Return the table of a comparison for a terminal."""
    from rich import box
    from rich.table import Table

    seeds = comparison.seeds
    table = Table(
        title=f'{comparison.title}; {len(seeds)} seeds from {seeds[0]}',
        title_justify='left',
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    errors = ('RMSE m', '/bound', 'mean m', 'max m', 'heading °', '/bound')
    headings = ('', *errors, 'NEES', 'in %', 'NIS', 'in %', 'pose %')
    for index, heading in enumerate(headings):
        table.add_column(heading, justify='right' if index else 'left', no_wrap=True)
    bound, turned = comparison.bound_rmse, comparison.bound_heading_rmse
    table.add_row('bound', f'{bound:.4f}', '', '', '', f'{degrees(turned):.3f}', end_section=True)
    for item in comparison.estimators:
        nees, nis = item.average_nees, item.average_nis
        table.add_row(
            item.name,
            f'{item.rmse:.4f}',
            f'{item.rmse / bound:.3f}',
            f'{item.mean:.4f}',
            f'{item.max:.3f}',
            f'{degrees(item.heading_rmse):.3f}',
            f'{item.heading_rmse / turned:.3f}',
            _figure(nees.mean),
            _share(nees.inside),
            _figure(nis.mean),
            _share(nis.inside),
            _share(item.known),
        )
    return table


def _figure(value: float) -> str:
    return '-' if isnan(value) else f'{value:.2f}'


def _share(value: float) -> str:
    return '-' if isnan(value) else f'{100.0 * value:.1f}'
