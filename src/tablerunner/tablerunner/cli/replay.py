"""`tablerunner replay`: a bag through the estimators, without ROS."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from tablerunner.cli.exits import FAILED

if TYPE_CHECKING:
    from tablerunner.bags.replay_config import ReplayConfig
    from tablerunner.cli.console import Progress
    from tablerunner.cli.replay_report import Replayed


def replay(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    estimator: Annotated[
        str,
        typer.Option(
            metavar='E',
            help='Name of the estimator, e.g. ekf, dead_reckoning; several with commas, or all, '
            'for a table.',
        ),
    ] = 'ekf',
    scenario: Annotated[
        Optional[Path],
        typer.Option(
            metavar='F', help='Robot and anchors; scenario.yaml in or beside BAG if not given.'
        ),
    ] = None,
    params: Annotated[
        Optional[list[Path]],
        typer.Option(
            metavar='FILE', help="ROS parameter file of the robot's nodes; may be given often."
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
    smooth: Annotated[
        bool,
        typer.Option('--smooth', help='Smooth the path too: what all the data say of each time.'),
    ] = False,
    from_s: Annotated[
        float,
        typer.Option(
            '--from', metavar='SECONDS', min=0.0, help='Give errors from this time on as well.'
        ),
    ] = 0.0,
) -> None:
    """Run a bag through the estimation code of the nodes: same bag, same result, bit for bit.

    Errors are against /ground_truth, where the bag has it, from the moment the estimator declares
    itself initialised; those of the smoothed path from the first odometry on. Exit code 1: the
    estimator (with several: one of them) never found its start.

    Example: tablerunner replay out/demo/bag --json out/replay.json
    """
    from dataclasses import replace as changed

    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import estimator_names, find_scenario, replay_config
    from tablerunner.cli.replay_report import table
    from tablerunner.errors import ConfigError
    from tablerunner.estimation.smoother import SMOOTHED

    names = estimator_names(estimator)
    if plot_file is not None and len(names) > 1:
        raise ConfigError('--plot', ', '.join(names), 'one estimator', 'options')
    if smooth and not set(names) & set(SMOOTHED):
        expected = 'one of ' + ', '.join(SMOOTHED) + ' as estimator'
        raise ConfigError('--smooth', ', '.join(names), expected, 'options')
    room = find_scenario(bag, scenario)
    items = []
    with Progress() as progress:
        for name in names:
            config = changed(
                replay_config(room, name, start, namespace, tuple(params or ())),
                fixes=plot_file is not None,
                keep=smooth and name in SMOOTHED,
            )
            items.append(_replayed(bag, config, from_s, progress))
        for item in items[0].result.damage:
            progress.say(f'damaged: {item}', 'yellow')
    for line in items[0].lines() if len(items) == 1 else table(items):
        typer.echo(line)
    if json_file is not None:
        figures = [item.figures() for item in items]
        write_json(json_file, figures[0] if len(figures) == 1 else figures)
    if plot_file is not None:
        from tablerunner.bags.trips import trip_of_replay
        from tablerunner.evaluation.plots import draw_trip

        draw_trip(trip_of_replay(items[0].result, f'Replay of {bag.name}'), room, plot_file)
        typer.echo(f'picture        {plot_file}')
    if any(item.result.initialised is None for item in items):
        raise typer.Exit(FAILED)


def _replayed(
    bag: Path, config: 'ReplayConfig', from_s: float, progress: 'Progress'
) -> 'Replayed':
    from tablerunner.bags.reader import BagReader
    from tablerunner.bags.replay import replay as run
    from tablerunner.bags.smoothing import smoothed_errors
    from tablerunner.cli.replay_report import Replayed

    progress.show(f'replaying {bag}: {config.localizer.estimator}')
    begun = time.perf_counter()
    with BagReader(bag) as reader:
        result = run(reader, config)
    took = time.perf_counter() - begun
    smoothed = None
    if config.keep:
        progress.show(f'smoothing {bag}: {config.localizer.estimator}')
        smoothed = smoothed_errors(result)
    return Replayed(result, bag, took, from_s, smoothed)
