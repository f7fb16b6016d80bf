"""`tablerunner replay`: a bag through the estimators, without ROS."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from tablerunner.cli.exits import FAILED

if TYPE_CHECKING:
    from tablerunner.bags.replay import ReplayResult


def replay(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    estimator: Annotated[
        str, typer.Option(metavar='E', help='Name of the estimator, e.g. ekf, dead_reckoning.')
    ] = 'ekf',
    scenario: Annotated[
        Optional[Path],
        typer.Option(
            metavar='F', help='Robot and anchors; scenario.yaml in or beside BAG if not given.'
        ),
    ] = None,
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write the figures to a file.')
    ] = None,
    plot_file: Annotated[
        Optional[Path], typer.Option('--plot', metavar='FILE', help='Draw the trip as a PNG.')
    ] = None,
    start: Annotated[
        str,
        typer.Option(metavar='X,Y,YAW', help='Pose at the start; found by driving if not given.'),
    ] = '',
    namespace: Annotated[str, typer.Option(help='Namespace of the robot in the bag.')] = '',
) -> None:
    """Run a bag through the estimation code of the nodes: same bag, same result, bit for bit.

    Errors are against /ground_truth, where the bag has it, from the moment the estimator declares
    itself initialised. Exit code 1: it never did.

    Example: tablerunner replay out/demo/bag --json out/replay.json
    """
    from dataclasses import replace as changed

    from tablerunner.bags.reader import BagReader
    from tablerunner.bags.replay import replay as run
    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import find_scenario, replay_config

    room = find_scenario(bag, scenario)
    config = changed(replay_config(room, estimator, start, namespace), fixes=plot_file is not None)
    with Progress() as progress:
        progress.show(f'replaying {bag}')
        begun = time.perf_counter()
        with BagReader(bag) as reader:
            result = run(reader, config)
        took = time.perf_counter() - begun
        for item in result.damage:
            progress.say(f'damaged: {item}', 'yellow')
    for line in report(result, bag, took):
        typer.echo(line)
    if json_file is not None:
        write_json(json_file, figures(result, bag, took))
    if plot_file is not None:
        from tablerunner.bags.trips import trip_of_replay
        from tablerunner.evaluation.plots import draw_trip

        draw_trip(trip_of_replay(result, f'Replay of {bag.name}'), room, plot_file)
        typer.echo(f'picture        {plot_file}')
    if result.initialised is None:
        raise typer.Exit(FAILED)


def figures(result: 'ReplayResult', bag: Path, took_s: float) -> dict[str, Any]:
    """Return what ``--json`` writes; lengths in m, times in s."""
    summary = result.errors.summary()
    sources = result.by_source()
    return {
        'bag': str(bag),
        'estimator': result.estimator,
        'state': result.state.value,
        'initialised_after': _initialised_after(result),
        'rmse': summary.rmse,
        'mean': summary.mean,
        'max': summary.max,
        'final': summary.final,
        'heading_rmse': summary.heading_rmse,
        'compared': summary.count,
        'accepted': {name: item.accepted for name, item in sources.items()},
        'nis': {name: item.nis.mean for name, item in sources.items()},
        'measurements': {name: item.count for name, item in sources.items()},
        'refused': {
            f'{source}: {reason}': count for (source, reason), count in result.refusals.items()
        },
        'damage': [str(item) for item in result.damage],
        'data_seconds': result.data_s,
        'seconds': took_s,
    }


def report(result: 'ReplayResult', bag: Path, took_s: float) -> list[str]:
    """Return the lines for people."""
    inputs = [topic for topic in result.sources if topic != 'ground_truth']
    lines = [f'bag            {bag}: {result.data_s:.1f} s of ' + ', '.join(inputs)]
    after = _initialised_after(result)
    words = 'never initialised' if after is None else f'initialised after {after:.1f} s'
    lines.append(f'estimator      {result.estimator}, {words}, {result.state.value} at the end')
    summary = result.errors.summary()
    if summary.count:
        lines.append(
            f'position error rmse {summary.rmse:.3f} m, mean {summary.mean:.3f} m, '
            f'max {summary.max:.3f} m, final {summary.final:.3f} m'
        )
    else:
        lines.append('position error unknown: no truth at the times of the estimates')
    for source, item in result.by_source().items():
        lines.append(
            f'{source:<14} {100 * item.accepted:.1f} % of {item.count} accepted, '
            f'mean NIS {item.nis.mean:.2f}'
        )
    for (source, reason), count in result.refusals.items():
        lines.append(f'{source:<14} {count} refused: {reason}')
    lines.append(f'took           {took_s:.2f} s, {result.data_s / took_s:.0f} times real time')
    return lines


def _initialised_after(result: 'ReplayResult') -> float | None:
    if result.initialised is None:
        return None
    first = int(result.first_stamp)
    return (result.initialised - first) * 1e-9
