"""`tablerunner calibrate`: what sensors read wrong, from a bag in which the truth is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

from tablerunner.errors import ConfigError

if TYPE_CHECKING:
    from tablerunner.bags.range_pairs import RangePairs
    from tablerunner.uwb.range_calibration import RangeCalibration

calibrate_app = typer.Typer(
    help='Find what sensors read wrong, from a bag in which the truth is known.',
    no_args_is_help=True,
)


@calibrate_app.callback()
def calibrate() -> None:
    """Find what sensors read wrong, from a bag in which the truth is known."""


@calibrate_app.command()
def ranges(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    output: Annotated[
        Path,
        typer.Option('-o', '--output', metavar='FILE', help='Parameter file; must not exist.'),
    ] = Path('out/uwb_driver.yaml'),
    at: Annotated[
        str, typer.Option(metavar='X,Y', help='Where the tag stood still; else ground_truth.')
    ] = '',
    scenario: Annotated[
        Optional[Path],
        typer.Option(
            metavar='F', help='Robot and anchors; scenario.yaml in or beside BAG if not given.'
        ),
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
    from tablerunner.cli.replay_options import find_scenario
    from tablerunner.evaluation.plots.calibration import draw_calibration
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.scenario import RobotGeometry
    from tablerunner.uwb.range_calibration import fit_calibration

    if output.exists():
        raise ConfigError('--output', str(output), 'a file that does not exist yet')
    place = parse_place(at)
    room = find_scenario(bag, scenario)
    robot = RobotGeometry() if room is None else room.robot
    anchors = () if room is None else tuple(item.anchor for item in room.anchors)
    with Progress() as progress, BagReader(bag) as reader:
        progress.show(f'reading {bag}')
        found = range_pairs(reader, anchors, robot.tag_position, place, namespace)
    fits = {item.anchor.anchor_id: fit_calibration(item.true, item.raw) for item in found}
    for line in report(found, fits):
        typer.echo(line)
    text = parameter_text(found, fits)
    typer.echo(text)
    picture = output.with_suffix('.png')
    pairs = {item.anchor.anchor_id: (item.true, item.raw) for item in found}
    write_sheet(partial(draw_calibration, fits=fits, pairs=pairs), picture)
    output.write_text(text + '\n', encoding='utf-8')
    typer.echo(f'written: {output}, {picture}')


def parse_place(text: str) -> Optional[tuple[float, float]]:
    """Return the two numbers of ``X,Y``; None for an empty text."""
    if not text.strip():
        return None
    try:
        x, y = (float(part) for part in text.split(','))
    except ValueError:
        x = y = float('nan')
    if not (abs(x) < float('inf') and abs(y) < float('inf')):
        raise ConfigError('--at', text, 'X,Y: two numbers in m', 'options')
    return x, y


def report(found: 'tuple[RangePairs, ...]', fits: 'dict[str, RangeCalibration]') -> list[str]:
    """Return bias and scale of each anchor with standard errors, in words."""
    lines = [
        f'{"anchor":<10} {"bias [m]":>18} {"scale":>20} {"noise [m]":>10} {"ranges":>7} '
        f'{"blocked":>8}'
    ]
    for item in found:
        fit = fits[item.anchor.anchor_id]
        bias_error, scale_error = (float(value) ** 0.5 for value in fit.covariance.diagonal())
        scale = f'{fit.scale:+.4f} +- {scale_error:.4f}' if fit.scale_fitted else 'not fitted'
        lines.append(
            f'{item.anchor.anchor_id:<10} {fit.bias_m:+9.3f} +- {bias_error:.3f} {scale:>20} '
            f'{fit.residual_std_m:>10.3f} {fit.count:>7} {item.blocked:>8}'
        )
    still = [anchor_id for anchor_id, fit in fits.items() if not fit.scale_fitted]
    if still:
        lines.append(
            f'{", ".join(still)}: the true ranges span less than 2 m, so that only a bias can be '
            'found; it holds about this distance.'
        )
    return lines


def parameter_text(found: 'tuple[RangePairs, ...]', fits: 'dict[str, RangeCalibration]') -> str:
    """Return the lines of a parameter file that uwb_driver reads."""
    import yaml

    def rounded(values: list[float]) -> list[float]:
        return [round(float(value), 5) for value in values]

    noise = sorted(fit.residual_std_m for fit in fits.values())
    own = {
        'anchor_ids': list(fits),
        'anchor_positions': rounded([v for item in found for v in item.anchor.position]),
        'anchor_biases': rounded([fit.bias_m for fit in fits.values()]),
        'anchor_scales': rounded([fit.scale for fit in fits.values()]),
        'range_std': round(max(noise[len(noise) // 2], 0.001), 4),
    }
    text = yaml.safe_dump(
        {'/**/uwb_driver': {'ros__parameters': own}}, sort_keys=False, default_flow_style=None
    )
    return str(text).rstrip()
