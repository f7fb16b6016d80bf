"""`tablerunner tune`: noise from the innovations of a bag, without truth."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

if TYPE_CHECKING:
    from tablerunner.bags.replay_config import ReplayConfig
    from tablerunner.estimation.likelihood import Drive
    from tablerunner.types import Anchor

_LIKELY_RUNS = 600  # what the bar counts to; most searches end before


def tune(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    estimator: Annotated[
        str, typer.Option(metavar='E', help='Estimator to tune for: ekf or ukf.')
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
    output: Annotated[
        Optional[Path],
        typer.Option('--out', metavar='FILE', help='Write the parameter file, a new .yaml.'),
    ] = None,
    start: Annotated[
        str,
        typer.Option(metavar='X,Y,YAW', help='Pose at the start; found by driving if not given.'),
    ] = '',
    namespace: Annotated[str, typer.Option(help='Namespace of the robot in the bag.')] = '',
    params: Annotated[
        Optional[list[Path]],
        typer.Option(
            metavar='FILE', help="ROS parameter file of the robot's nodes; may be given often."
        ),
    ] = None,
) -> None:
    """Find the noise under which the ranges of a bag are most likely; no truth is needed.

    Prints the parameters to use for fusion_node and uwb_driver, and how consistent the estimator
    is before and after. What the bag does not show stays at its default and is called held.
    Drive a few minutes of what the robot does every day, with curves. Exit code 1: too few ranges.

    Example: tablerunner tune out/demo/bag --out out/tuned.yaml
    """
    from functools import partial

    from tablerunner.cli.bar import Bar
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import find_scenario, replay_config
    from tablerunner.cli.tune_report import TuneReport
    from tablerunner.errors import ConfigError
    from tablerunner.estimation import ESTIMATORS
    from tablerunner.estimation import tuning as core

    if estimator not in ('ekf', 'ukf'):
        raise ConfigError('--estimator', estimator, 'ekf or ukf', 'options')
    if output is not None and (output.suffix not in ('.yaml', '.yml') or output.exists()):
        expected = 'a name that ends with .yaml, of a file that does not exist yet'
        raise ConfigError('--out', str(output), expected, 'options')
    begun = time.perf_counter()
    room = find_scenario(bag, scenario)
    config = replay_config(room, estimator, start, namespace, tuple(params or ()))
    drives, anchors = _drives(bag, config)
    x, y, z = config.localizer.tag_position
    make = partial(ESTIMATORS[estimator], anchors=anchors, lever_arm=(x, y, z))
    with Bar(f'tuning on {bag}') as bar:
        found = core.tune(
            make,
            config.localizer.filter,
            drives,
            progress=lambda runs: bar.show(runs, max(runs, _LIKELY_RUNS)),
        )
    report = TuneReport(found, bag, estimator, time.perf_counter() - begun)
    for line in report.lines():
        typer.echo(line)
    text = report.parameter_text()
    typer.echo(text)
    if output is not None:
        try:
            output.parent.mkdir(parents=True, exist_ok=True)
            output.write_text(text + '\n', encoding='utf-8')
        except OSError as error:
            expected = f'a file that can be written ({error.strerror})'
            raise ConfigError('--out', str(output), expected, 'options') from error
        typer.echo(f'written: {output}')
    if json_file is not None:
        write_json(json_file, report.figures())


def _drives(bag: Path, config: 'ReplayConfig') -> 'tuple[list[Drive], tuple[Anchor, ...]]':
    """Return the drives of a bag, decoded once, and the anchors that were used."""
    from dataclasses import replace as changed

    from tablerunner.bags.reader import BagReader
    from tablerunner.bags.replay import replay
    from tablerunner.cli.console import Progress
    from tablerunner.errors import TuningError
    from tablerunner.estimation.likelihood import drive_of

    with Progress() as progress:
        progress.show(f'replaying {bag}')
        with BagReader(bag) as reader:
            result = replay(reader, changed(config, keep=True))
        for item in result.damage:
            progress.say(f'damaged: {item}', 'yellow')
    if not result.runs:
        raise TuningError(
            f'{bag}: the estimator never found its start, so that there is nothing to tune on; '
            'give --start, or record a drive with curves'
        )
    return [drive_of(run) for run in result.runs], result.anchors
