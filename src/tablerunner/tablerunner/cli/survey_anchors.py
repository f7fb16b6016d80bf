"""`tablerunner survey-anchors`: where the anchors hang, from a drive."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from tablerunner.errors import ConfigError

if TYPE_CHECKING:
    from tablerunner.scenario import Scenario
    from tablerunner.survey.record import Survey
    from tablerunner.types import Anchor

NODE_FILE, SCENARIO_FILE, PLOT_FILE = 'uwb_driver.yaml', 'scenario.yaml', 'survey.png'


def survey_anchors(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    at: Annotated[
        Optional[list[str]],
        typer.Option(
            metavar='ID=X,Y[,Z]',
            help='Where an anchor is, in m; two of them fix the map. Else --start does.',
        ),
    ] = None,
    start: Annotated[
        str, typer.Option(metavar='X,Y,YAW', help='Pose at the start of the drive; else 0,0,0.')
    ] = '',
    height: Annotated[
        Optional[list[str]],
        typer.Option(
            metavar='[ID=]Z',
            help='Known height over the floor in m, of one anchor or of all; else estimated.',
        ),
    ] = None,
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
    output: Annotated[
        Path, typer.Option('-o', '--output', metavar='DIR', help='Folder of what is written.')
    ] = Path('out/survey'),
    scenario: Annotated[
        Optional[Path],
        typer.Option(metavar='F', help='The robot; scenario.yaml in or beside BAG if not given.'),
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
    """Find where the anchors hang, from the ranges and the odometry of a drive.

    Ranges between anchors help, where the bag has them. Drive 20 to 40 m slowly, round corners and
    best in a loop: docs/survey.md. Writes uwb_driver.yaml (for the node), scenario.yaml and
    survey.png into a folder.

    Example: tablerunner survey-anchors drive/ --at A0=0,0 --at A1=15,0 --height 2.25
    """
    from functools import partial

    from tablerunner.bags.drives import read_drive
    from tablerunner.bags.reader import BagReader
    from tablerunner.cli.calibrate_camera import write_text
    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.cli.replay_options import (
        find_scenario,
        find_scenario_file,
        parse_start,
        replay_config,
    )
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.evaluation.plots.survey import draw_survey
    from tablerunner.survey.record import SurveyConfig, SurveyData
    from tablerunner.survey.survey import survey

    fixed = parse_places(at or [])
    heights = parse_heights(height or [])
    if fixed and start.strip():
        raise ConfigError('--start', start, 'either --start or --at', 'options')
    pose = parse_start(start) or (0.0, 0.0, 0.0)
    files = [output / NODE_FILE, output / SCENARIO_FILE, output / PLOT_FILE]
    for file in files:
        if file.exists():
            raise ConfigError('--output', str(file), 'a file that does not exist yet', 'options')
    room = find_scenario(bag, scenario)
    settings = replay_config(room, 'ekf', '', namespace, tuple(params or ()))
    x, y, z = settings.localizer.tag_position
    tag = (x, y, z)
    with Progress() as progress, BagReader(bag) as reader:
        progress.show(f'reading {bag}')
        drive = read_drive(reader, settings.odometer, namespace, bias_std > 0.0, settings.names)
        for item in reader.damage:
            progress.say(f'damaged: {item}', 'yellow')
        for note in drive.notes:
            progress.say(note, 'yellow')
        if room is None:
            progress.say(f'no scenario: the tag is taken to be at {tag} in base_link [m]')
        progress.show(f'{len(drive.ranges.stamps)} ranges on {drive.track.way[-1]:.1f} m')
        try:
            found = survey(
                SurveyData(drive.track, drive.ranges, tag, drive.links),
                SurveyConfig(
                    heights={
                        name: heights.get(name, heights.get('', 0.0))
                        for name in {*drive.ranges.ids, *heights} - {''}
                        if '' in heights or name in heights
                    },
                    fixed=fixed,
                    start=(pose[0], pose[1], pose[2]),
                    bias_std_m=bias_std,
                    scale_std=0.005 if bias_std > 0.0 else 0.0,
                    noise=settings.odometer.noise,
                ),
            )
        except ConfigError as error:
            raise error.located(str(bag)) from None
    told = known_places(room, drive.anchors)
    for line in report(found, told, len(drive.links), sum(drive.blocked.values())):
        typer.echo(line)
    text = node_text(found, bias_std > 0.0)
    plan = scenario_text(found, find_scenario_file(bag, scenario), tag)
    write_text(files[0], text)
    write_text(files[1], plan)
    write_sheet(partial(draw_survey, found=found, known=told if fixed else None), files[2])
    if json_file is not None:
        write_json(json_file, {'bag': str(bag), **figures(found, told)})
    typer.echo('written: ' + ', '.join(str(file) for file in files))


def parse_places(texts: 'list[str]') -> 'dict[str, tuple[float, ...]]':
    """Return the places of ``ID=X,Y`` or ``ID=X,Y,Z``."""
    found: dict[str, tuple[float, ...]] = {}
    for text in texts:
        name, _, rest = text.partition('=')
        numbers = _numbers(rest)
        if not name.strip() or len(numbers) not in (2, 3) or name.strip() in found:
            raise ConfigError('--at', text, 'ID=X,Y or ID=X,Y,Z: numbers in m, each ID once')
        found[name.strip()] = numbers
    return found


def parse_heights(texts: 'list[str]') -> 'dict[str, float]':
    """Return the heights of ``ID=Z``, and of ``Z`` by an empty name."""
    found: dict[str, float] = {}
    for text in texts:
        name, sign, rest = text.rpartition('=')
        numbers = _numbers(rest)
        if len(numbers) != 1 or (sign and not name.strip()) or name.strip() in found:
            raise ConfigError('--height', text, 'Z or ID=Z: a number in m, each ID once')
        found[name.strip()] = numbers[0]
    return found


def _numbers(text: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(','))
    except ValueError:
        return ()
    return numbers if all(math.isfinite(number) for number in numbers) else ()


def known_places(
    room: 'Optional[Scenario]', anchors: 'tuple[Anchor, ...]'
) -> 'dict[str, tuple[float, float, float]]':
    """Return where the anchors are said to be: by the scenario, or by the bag."""
    if room is not None and room.anchors:
        return {place.id: place.position for place in room.anchors}
    return {anchor.anchor_id: anchor.position for anchor in anchors}


def apart(
    found: 'Survey', told: 'dict[str, tuple[float, float, float]]'
) -> 'Optional[list[float]]':
    """Return the RMS distance to told places over the floor, as they are and laid on them [m]."""
    import numpy as np

    from tablerunner.survey.track import laid_on

    both = [item for item in found.anchors if item.anchor_id in told]
    if len(both) < 3:
        return None
    here = np.array([item.position[:2] for item in both])
    there = np.array([told[item.anchor_id][:2] for item in both])
    laid, _ = laid_on(here, there)
    return [
        float(np.sqrt(np.mean(np.sum((places - there) ** 2, axis=1)))) for places in (here, laid)
    ]


def report(
    found: 'Survey',
    told: 'dict[str, tuple[float, float, float]]',
    links: int = 0,
    blocked: int = 0,
) -> list[str]:
    """Return what was found, in words."""
    lines = [
        f'{"anchor":<8} {"x [m]":>8} {"y [m]":>8} {"z [m]":>8}   sigma of x, y, z [m]   '
        f'{"bias [m]":>16} {"ranges":>7} {"off":>6}'
    ]
    for item in found.anchors:
        x, y, z = item.position
        stds = '  '.join(f'{value:.3f}' for value in item.std)
        bias = f'{item.bias_m:+.3f} +- {item.bias_std_m:.3f}' if item.bias_std_m else 'none'
        lines.append(
            f'{item.anchor_id:<8} {x:>8.3f} {y:>8.3f} {z:>8.3f}   {stds:>20}   '
            f'{bias:>16} {item.ranges:>7} {100.0 * item.blocked:>4.1f} %'
        )
    lines.append('off: share of the ranges that do not fit, as behind things and people')
    if blocked:
        lines.append(
            f'{blocked} ranges more were left out: their signal says that they are blocked'
        )
    if links:
        lines.append(f'ranges between anchors: {links} pairs')
    vague = [item.anchor_id for item in found.anchors if item.std[2] > 0.3]
    if vague:
        lines.append(f'heights of {", ".join(vague)} hardly show: measure them, and give --height')
    lines += [
        f'{name}: only {count} ranges: left out' for name, count in found.left_out.items() if count
    ]
    lines.append(f'noise of a range {found.range_std_m:.3f} m')
    lines.append(
        f'odometry tells the way {-100.0 * found.way[0]:+.2f} +- {100.0 * found.way[1]:.2f} % too '
        f'long, turns {-100.0 * found.turns[0]:+.2f} +- {100.0 * found.turns[1]:.2f} % too large'
    )
    off = apart(found, told)
    if off is not None:
        lines.append(
            f'against the places that were told: {off[0]:.3f} m RMS; moved and turned onto them '
            f'{off[1]:.3f} m'
        )
    return lines


def figures(found: 'Survey', told: 'dict[str, tuple[float, float, float]]') -> dict[str, Any]:
    """Return what was found, for JSON."""
    off = apart(found, told)
    return {
        'anchors': [
            {
                'id': item.anchor_id,
                'position': item.position.tolist(),
                'std': item.std.tolist(),
                'covariance': item.covariance.tolist(),
                'bias_m': item.bias_m,
                'bias_std_m': item.bias_std_m,
                'scale': item.scale,
                'ranges': item.ranges,
                'off': item.blocked,
            }
            for item in found.anchors
        ],
        'covariance': found.covariance.tolist(),
        'left_out': dict(found.left_out),
        'range_std_m': found.range_std_m,
        'odometry': {'way': found.way, 'turns': found.turns, 'drift_rad_s': found.drift},
        'against_told_m': None if off is None else off[0],
        'against_told_moved_m': None if off is None else off[1],
    }


def node_text(found: 'Survey', biases: bool) -> str:
    """Return the lines of a parameter file that uwb_driver reads."""
    import yaml

    from tablerunner.config import Document, build
    from tablerunner.uwb import RangerConfig

    own: dict[str, Any] = {
        'anchor_ids': [item.anchor_id for item in found.anchors],
        'anchor_positions': [
            round(float(value), 4) for item in found.anchors for value in item.position
        ],
    }
    if biases:
        own['anchor_biases'] = [round(item.bias_m, 4) for item in found.anchors]
        own['anchor_scales'] = [round(item.scale, 5) for item in found.anchors]
    own['range_std'] = round(max(found.range_std_m, 0.001), 4)
    build(RangerConfig, Document(own, 'survey'))
    stds = [
        f'#   {item.anchor_id}: ' + ', '.join(f'{value:.3f}' for value in item.std)
        for item in found.anchors
    ]
    head = '\n'.join(['# Standard deviations of x, y, z [m]; 0: given.', *stds])
    text = yaml.safe_dump(
        {'/**/uwb_driver': {'ros__parameters': own}}, sort_keys=False, default_flow_style=None
    )
    return f'{head}\n{text}'


def scenario_text(found: 'Survey', file: Optional[Path], tag: tuple[float, float, float]) -> str:
    """Return a scenario file with the anchors that were found, the rest as it was."""
    import yaml

    content: dict[str, Any] = {'name': 'surveyed'}
    if file is None:
        content['robot'] = {'tag_position': list(tag)}
    else:
        content = yaml.safe_load(file.read_text(encoding='utf-8'))
    content['anchors'] = [
        {'id': item.anchor_id, 'position': [round(float(v), 4) for v in item.position]}
        for item in found.anchors
    ]
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))
