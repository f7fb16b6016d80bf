"""`tablerunner calibrate wheels`: radii and track, from a drive among known anchors."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from tablerunner.errors import ConfigError

if TYPE_CHECKING:
    from tablerunner.survey.wheels import WheelFit


def wheels(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    output: Annotated[
        Path,
        typer.Option(
            '-o', '--output', metavar='FILE', help='Parameter file (.yaml); must not exist.'
        ),
    ] = Path('out/odom_node.yaml'),
    bias_std: Annotated[
        float,
        typer.Option(
            metavar='M',
            min=0.0,
            max=1.0,
            help='How much too long or short an anchor may read all the time; 0: ranges are '
            'calibrated already.',
        ),
    ] = 0.1,
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
    namespace: Annotated[str, typer.Option(help='Namespace of the robot in the bag.')] = '',
) -> None:
    """Find the radii of the drive wheels and their distance, for odom_node.

    From encoders, ranges to anchors whose places are known and, where there is one, a gyroscope.
    Drive 40 m or more with turns to both sides: docs/survey.md. Writes the parameter file, and a
    picture beside it.

    Example: tablerunner calibrate wheels out/demo/bag -o out/odom_node.yaml
    """
    from functools import partial

    from tablerunner.bags.drives import read_drive
    from tablerunner.bags.reader import BagReader
    from tablerunner.cli.calibrate_camera import write_text
    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import find_scenario, replay_config
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.evaluation.plots.survey import draw_wheels
    from tablerunner.survey.wheel_motion import Sizes
    from tablerunner.survey.wheels import WheelConfig, WheelData, fit_wheels

    if output.suffix not in ('.yaml', '.yml'):
        raise ConfigError('--output', str(output), 'a name that ends with .yaml', 'options')
    picture = output.with_suffix('.png')
    for file in (output, picture):
        if file.exists():
            raise ConfigError('--output', str(file), 'a file that does not exist yet', 'options')
    room = find_scenario(bag, scenario)
    settings = replay_config(room, 'ekf', '', namespace, tuple(params or ()))
    with Progress() as progress, BagReader(bag) as reader:
        progress.show(f'reading {bag}')
        drive = read_drive(reader, settings.odometer, namespace, bias_std > 0.0, settings.names)
        for item in reader.damage:
            progress.say(f'damaged: {item}', 'yellow')
        for note in drive.notes:
            progress.say(note, 'yellow')
        if drive.wheels is None:
            raise ConfigError('joint_states', 'none', 'angles of both drive wheels', str(bag))
        anchors = drive.anchors if room is None else tuple(a.anchor for a in room.anchors)
        own, tag = settings.odometer.wheels, settings.localizer.tag_position
        progress.show(f'{len(drive.ranges.stamps)} ranges on {drive.track.way[-1]:.1f} m')
        try:
            fit = fit_wheels(
                WheelData(
                    drive.wheels,
                    drive.track,
                    drive.ranges,
                    anchors,
                    (tag[0], tag[1], tag[2]),
                    Sizes(own.wheel_radius, own.wheel_radius, own.track),
                ),
                WheelConfig(
                    bias_std_m=bias_std,
                    scale_std=0.005 if bias_std > 0.0 else 0.0,
                    noise=settings.odometer.noise,
                ),
            )
        except ConfigError as error:
            raise error.located(str(bag)) from None
    for line in report(fit):
        typer.echo(line)
    text = node_text(fit)
    typer.echo(text)
    write_text(output, text + '\n')
    places = {anchor.anchor_id: anchor.position for anchor in anchors}
    write_sheet(partial(draw_wheels, fit=fit, anchors=places), picture)
    if json_file is not None:
        write_json(json_file, {'bag': str(bag), **figures(fit)})
    typer.echo(f'written: {output}, {picture}')


def report(fit: 'WheelFit') -> list[str]:
    """Return what was found, in words."""
    lines = [f'{"":<14} {"found [mm]":>22} {"nominal [mm]":>13} {"larger by":>20}']
    for name, value, std, nominal in zip(
        ('left radius', 'right radius', 'track'),
        fit.sizes.values,
        fit.std,
        fit.nominal.values,
        strict=True,
    ):
        found = f'{1e3 * value:.3f} +- {1e3 * std:.3f}'
        share = f'{100.0 * (value / nominal - 1.0):+.2f} +- {100.0 * std / nominal:.2f} %'
        lines.append(f'{name:<14} {found:>22} {1e3 * nominal:>13.2f} {share:>20}')
    radius, difference = fit.radius, fit.difference
    lines.append(
        f'mean radius {1e3 * radius[0]:.3f} +- {1e3 * radius[1]:.3f} mm; right larger than left '
        f'by {100.0 * difference[0]:+.3f} +- {100.0 * difference[1]:.3f} %'
    )
    if fit.gyro_scale is not None and fit.gyro_drift is not None:
        lines.append(
            f'gyroscope: turns {100.0 * fit.gyro_scale[0]:+.2f} +- '
            f'{100.0 * fit.gyro_scale[1]:.2f} % too large, drift in the beginning '
            f'{fit.gyro_drift[0]:+.5f} +- {fit.gyro_drift[1]:.5f} rad/s'
        )
    lines.append(f'{fit.ranges} ranges, noise of one {fit.range_std_m:.3f} m')
    return lines


def figures(fit: 'WheelFit') -> dict[str, Any]:
    """Return what was found, for JSON."""
    return {
        'left_radius_m': fit.sizes.left_radius_m,
        'right_radius_m': fit.sizes.right_radius_m,
        'track_m': fit.sizes.track_m,
        'std_m': fit.std.tolist(),
        'covariance_m2': fit.covariance.tolist(),
        'mean_radius_m': fit.radius[0],
        'mean_radius_std_m': fit.radius[1],
        'difference': fit.difference[0],
        'difference_std': fit.difference[1],
        'nominal_m': fit.nominal.values.tolist(),
        'gyro_scale': fit.gyro_scale,
        'gyro_drift_rad_s': fit.gyro_drift,
        'range_std_m': fit.range_std_m,
        'ranges': fit.ranges,
    }


def node_text(fit: 'WheelFit') -> str:
    """Return the lines of a parameter file that odom_node reads."""
    import yaml

    mean = fit.radius[0]
    own = {
        'wheels': {
            'wheel_radius': round(mean, 6),
            'left_radius_multiplier': round(fit.sizes.left_radius_m / mean, 6),
            'right_radius_multiplier': round(fit.sizes.right_radius_m / mean, 6),
            'track': round(fit.sizes.track_m, 5),
        }
    }
    text = yaml.safe_dump(
        {'/**/odom_node': {'ros__parameters': own}}, sort_keys=False, default_flow_style=False
    )
    return str(text).rstrip()
