"""`tablerunner calibrate`: what sensors read wrong, from recordings where the truth is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from tablerunner.cli.calibrate_camera import camera
from tablerunner.cli.calibrate_wheels import wheels
from tablerunner.errors import ConfigError, GeometryError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tablerunner.bags.range_pairs import RangePairs
    from tablerunner.uwb.range_calibration import RangeCalibration

LEAST_RANGES = 20
"""An anchor with fewer ranges is not calibrated."""

WORST_NOISE_M = 0.5
"""No radio's ranges scatter as much: the true places must be wrong."""

calibrate_app = typer.Typer(
    help='Find what sensors read wrong: ranges and wheels from a bag, a camera from pictures.',
    no_args_is_help=True,
)


@calibrate_app.callback()
def calibrate() -> None:
    """Find what sensors read wrong: ranges and wheels from a bag, a camera from pictures."""


calibrate_app.command()(camera)
calibrate_app.command()(wheels)


@calibrate_app.command()
def ranges(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    output: Annotated[
        Path,
        typer.Option(
            '-o', '--output', metavar='FILE', help='Parameter file (.yaml); must not exist.'
        ),
    ] = Path('out/uwb_driver.yaml'),
    at: Annotated[
        str,
        typer.Option(
            metavar='X,Y[,Z]', help='Where the tag stood still in map; else ground_truth.'
        ),
    ] = '',
    truth: Annotated[
        Optional[Path],
        typer.Option(
            metavar='FILE', help='True positions as lines t,x,y[,heading] after a header line.'
        ),
    ] = None,
    scenario: Annotated[
        Optional[Path],
        typer.Option(
            metavar='F', help='Robot and anchors; scenario.yaml in or beside BAG if not given.'
        ),
    ] = None,
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write the figures to a file.')
    ] = None,
    namespace: Annotated[str, typer.Option(help='Namespace of the robot in the bag.')] = '',
) -> None:
    """Find bias and scale of each anchor's ranges, for uwb_driver.

    From a drive with known positions, or from a robot that stood still at a known place, which
    gives biases only. Writes the parameter file, and a picture beside it.

    Example: tablerunner calibrate ranges out/demo/bag -o out/uwb_driver.yaml
    """
    from functools import partial

    from tablerunner.bags.range_pairs import range_pairs
    from tablerunner.bags.reader import BagReader
    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import find_scenario
    from tablerunner.evaluation.plots.calibration import draw_calibration
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.evaluation.truth_file import read_truth
    from tablerunner.scenario import RobotGeometry

    picture = output.with_suffix('.png')
    check_new(output, picture)
    if at.strip() and truth is not None:
        raise ConfigError('--truth', str(truth), 'either --truth or --at', 'options')
    path = None if truth is None else read_truth(truth)
    room = find_scenario(bag, scenario)
    robot = RobotGeometry() if room is None else room.robot
    place = parse_place(at, robot.tag_position[2])
    anchors = () if room is None else tuple(item.anchor for item in room.anchors)
    with Progress() as progress, BagReader(bag) as reader:
        progress.show(f'reading {bag}')
        found = range_pairs(reader, anchors, robot.tag_position, place, namespace, path)
        for item in reader.damage:
            progress.say(f'damaged: {item}', 'yellow')
        if room is None and (place is None or at.count(',') < 2):
            progress.say(f'no scenario: the tag is taken to be at {robot.tag_position} [m]')
    fits = fit_all(found)
    text = parameter_text(found, fits)
    for line in report(found, fits):
        typer.echo(line)
    typer.echo(text)
    pairs = {item.anchor.anchor_id: (item.true, item.raw) for item in found}
    write_sheet(partial(draw_calibration, fits=fits, pairs=pairs), picture)
    output.write_text(text + '\n', encoding='utf-8')
    if json_file is not None:
        write_json(json_file, {'bag': str(bag), 'anchors': figures(found, fits)})
    typer.echo(f'written: {output}, {picture}')


def check_new(output: Path, picture: Path) -> None:
    """Raise if one of the files to write is there already."""
    if output.suffix not in ('.yaml', '.yml'):
        raise ConfigError('--output', str(output), 'a name that ends with .yaml', 'options')
    for file in (output, picture):
        if file.exists():
            raise ConfigError('--output', str(file), 'a file that does not exist yet', 'options')


def parse_place(text: str, height: float) -> Optional[tuple[float, float, float]]:
    """Return the place of ``X,Y`` at a height or of ``X,Y,Z``; None for an empty text."""
    if not text.strip():
        return None
    try:
        numbers = [float(part) for part in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(abs(item) < float('inf') for item in numbers):
        raise ConfigError('--at', text, 'X,Y or X,Y,Z: numbers in m', 'options')
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else height


def fit_all(found: 'Sequence[RangePairs]') -> 'dict[str, RangeCalibration]':
    """Return the calibration of each anchor that was heard often enough.

    Raises
    ------
    ConfigError
        None was, the ranges of one do not settle a line, or scatter so much that the true places
        cannot be right.
    """
    from tablerunner.uwb.range_calibration import fit_calibration

    fits = {}
    for item in found:
        if len(item.true) < LEAST_RANGES:
            continue
        name = item.anchor.anchor_id
        try:
            fits[name] = fit_calibration(item.true, item.raw, blocked=True)
        except GeometryError as error:
            raise ConfigError(
                f'anchor {name}', f'{len(item.true)} ranges', f'ranges of one line ({error})'
            ) from error
        if fits[name].residual_std_m > WORST_NOISE_M:
            raise ConfigError(
                f'noise of anchor {name}',
                f'{fits[name].residual_std_m:.2f} m',
                f'at most {WORST_NOISE_M} m: true places on the same clock, or a tag that stands',
            )
    if not fits:
        counts = ', '.join(f'{item.anchor.anchor_id}: {len(item.true)}' for item in found)
        raise ConfigError('ranges of each anchor', counts, f'{LEAST_RANGES} or more of one')
    return fits


def report(found: 'Sequence[RangePairs]', fits: 'Mapping[str, RangeCalibration]') -> list[str]:
    """Return bias and scale of each anchor with standard errors, in words."""
    lines = [
        f'{"anchor":<10} {"bias [m]":>18} {"scale":>20} {"noise [m]":>10} {"ranges":>7} '
        f'{"rejected":>8} {"blocked":>8}'
    ]
    for own in figures(found, fits):
        if own['id'] not in fits:
            continue
        scale = 'not fitted'
        if own['scale'] is not None:
            scale = f'{own["scale"]:+.4f} +- {own["scale_std"]:.4f}'
        lines.append(
            f'{own["id"]:<10} {own["bias_m"]:+9.3f} +- {own["bias_std_m"]:.3f} {scale:>20} '
            f'{own["noise_m"]:>10.3f} {own["ranges"]:>7} {own["rejected"]:>8} {own["blocked"]:>8}'
        )
    lines.append('blocked: by their signal, rejected: too far off the line; both are left out')
    still = [name for name, fit in fits.items() if not fit.scale_fitted]
    if still:
        lines.append(
            f'{", ".join(still)}: the true ranges span less than 2 m, so that only a bias can be '
            'found; it holds about this distance.'
        )
    unheard = [item for item in found if item.anchor.anchor_id not in fits]
    lines += [
        f'{item.anchor.anchor_id}: only {len(item.true)} ranges, {LEAST_RANGES} are needed: not '
        'calibrated, and left at zero'
        for item in unheard
    ]
    return lines


def figures(
    found: 'Sequence[RangePairs]', fits: 'Mapping[str, RangeCalibration]'
) -> list[dict[str, Any]]:
    """Return what is known of each anchor, for JSON."""
    rows: list[dict[str, Any]] = []
    for item in found:
        row: dict[str, Any] = {'id': item.anchor.anchor_id, 'ranges': len(item.true)}
        row['blocked'] = item.blocked
        fit = fits.get(item.anchor.anchor_id)
        if fit is not None:
            bias_std, scale_std = (float(value) ** 0.5 for value in fit.covariance.diagonal())
            row.update(
                bias_m=fit.bias_m,
                bias_std_m=bias_std,
                scale=fit.scale if fit.scale_fitted else None,
                scale_std=scale_std if fit.scale_fitted else None,
                noise_m=fit.residual_std_m,
                rejected=round(fit.rejected * fit.count),
                shortest_m=fit.shortest_m,
                longest_m=fit.longest_m,
            )
        rows.append(row)
    return rows


def parameter_text(found: 'Sequence[RangePairs]', fits: 'Mapping[str, RangeCalibration]') -> str:
    """Return the lines of a parameter file that uwb_driver reads.

    Raises
    ------
    ConfigError
        The node would refuse it: no radio is that far off, so that places must be wrong.
    """
    import yaml

    from tablerunner.config import Document, build
    from tablerunner.uwb import RangerConfig

    def rounded(values: list[float]) -> list[float]:
        return [round(float(value), 5) for value in values]

    names = [item.anchor.anchor_id for item in found]
    noise = sorted(fit.residual_std_m for fit in fits.values())
    own = {
        'anchor_ids': names,
        'anchor_positions': rounded([v for item in found for v in item.anchor.position]),
        'anchor_biases': rounded([fits[name].bias_m if name in fits else 0.0 for name in names]),
        'anchor_scales': rounded([fits[name].scale if name in fits else 0.0 for name in names]),
        'range_std': round(max(noise[len(noise) // 2], 0.001), 4),
    }
    try:
        build(RangerConfig, Document(own, 'calibration: are the true places right?'))
    except ConfigError as error:
        raise error.located('calibration') from None
    text = yaml.safe_dump(
        {'/**/uwb_driver': {'ros__parameters': own}}, sort_keys=False, default_flow_style=None
    )
    return str(text).rstrip()
