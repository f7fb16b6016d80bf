"""`tablerunner calibrate camera`: lens, place and colours of a ceiling camera, from pictures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional

import typer

from tablerunner.errors import ConfigError, GeometryError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tablerunner.cli.console import Progress
    from tablerunner.types import Lens
    from tablerunner.vision.calibration import Board, ColourFit, LensFit, MountFit
    from tablerunner.vision.calibration.points import PointsFile

    Picture = NDArray[np.uint8]

LENS_FILE, NODE_FILE, PLOT_FILE = 'camera_info.yaml', 'ceiling_camera.yaml', 'calibration.png'


def camera(
    boards: Annotated[
        Optional[list[Path]],
        typer.Argument(metavar='[PICTURE]...', help='Pictures of a chequerboard, for the lens.'),
    ] = None,
    board: Annotated[
        str, typer.Option(metavar='CxR', help='Inner corners of the board along and across.')
    ] = '9x6',
    square: Annotated[
        float, typer.Option(metavar='M', help='Side of a square of the board, in m.')
    ] = 0.03,
    camera_info: Annotated[
        Optional[Path],
        typer.Option(metavar='FILE', help='Lens that is known already, instead of pictures.'),
    ] = None,
    points: Annotated[
        Optional[Path],
        typer.Option(
            metavar='FILE', help='Marked points (.yaml), for place and colours: docs/camera.md.'
        ),
    ] = None,
    picture: Annotated[
        Optional[Path],
        typer.Option(metavar='FILE', help='Picture in which markers were marked, for colours.'),
    ] = None,
    output: Annotated[
        Path, typer.Option('-o', '--output', metavar='DIR', help='Folder of what is written.')
    ] = Path('out/camera'),
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write the figures to a file.')
    ] = None,
) -> None:
    """Find lens, place and marker colours of a camera under the ceiling, for ceiling_camera.

    Writes camera_info.yaml (the lens, for the camera's driver), ceiling_camera.yaml (place and
    colours, for the node) and calibration.png (what is left, enlarged) into a folder.

    Example: tablerunner calibrate camera boards/*.png --board 9x6 --square 0.03 --points room.yaml
    """
    from functools import partial

    from tablerunner.cli.console import Progress
    from tablerunner.cli.json_file import write_json
    from tablerunner.config import load
    from tablerunner.evaluation.plots.camera_calibration import draw_camera_calibration
    from tablerunner.evaluation.plots.sheet import write_sheet
    from tablerunner.vision.calibration.points import PointsFile
    from tablerunner.vision.camera_file import lens_text, read_lens

    given = list(boards or ())
    if bool(given) == (camera_info is not None):
        raise ConfigError(
            'PICTURE', len(given), 'pictures of a board, or else --camera-info', 'options'
        )
    pattern = parse_board(board, square)
    marked = None if points is None else load(PointsFile, points)
    if marked is not None and marked.markers and picture is None:
        raise ConfigError('--picture', 'nothing', 'the picture of the marked markers', 'options')
    files = [output / LENS_FILE, output / NODE_FILE, output / PLOT_FILE]
    for file in files:
        if file.exists():
            raise ConfigError('--output', str(file), 'a file that does not exist yet', 'options')
    fit: Optional[LensFit] = None
    with Progress() as progress:
        if camera_info is not None:
            lens = read_lens(camera_info)
        else:
            fit = fit_boards(given, pattern, progress)
            lens = fit.lens
        mount = None if marked is None else fit_place(lens, marked, points)
        colours = {} if marked is None else fit_colours(lens, marked, picture, points)
    for line in report(lens, fit, mount, colours):
        typer.echo(line)
    text = '' if marked is None else node_text(marked, mount, colours, points)
    write_text(output / LENS_FILE, lens_text(lens, 'ceiling_camera'))
    written = [output / LENS_FILE]
    if text:
        write_text(output / NODE_FILE, text)
        written.append(output / NODE_FILE)
    if fit is not None or mount is not None:
        import numpy as np

        clicked = None if marked is None else np.array([item.pixel for item in marked.points])
        draw = partial(
            draw_camera_calibration,
            size=(lens.width, lens.height),
            corners=() if fit is None else fit.corners,
            corner_residuals=() if fit is None else fit.residuals,
            points=clicked if mount is not None else None,
            point_residuals=None if mount is None else mount.residuals,
        )
        write_sheet(draw, output / PLOT_FILE)
        written.append(output / PLOT_FILE)
    if json_file is not None:
        write_json(json_file, figures(lens, fit, mount, colours))
    typer.echo('written: ' + ', '.join(str(file) for file in written))


def parse_board(text: str, square: float) -> 'Board':
    """Return the board of ``CxR`` and the side of its squares [m]."""
    from tablerunner.vision.calibration import Board

    parts = text.lower().split('x')
    if len(parts) != 2 or not all(part.isdigit() and int(part) >= 3 for part in parts):
        raise ConfigError('--board', text, 'inner corners as 9x6, 3 or more each way', 'options')
    if not 0.0 < square < 10.0:
        raise ConfigError('--square', square, 'a side above 0 and below 10 [m]', 'options')
    return Board(int(parts[0]), int(parts[1]), square)


def read_picture(file: Path) -> 'Picture':
    """Return a picture; blue, green, red.

    Raises
    ------
    ConfigError
        The file is none.
    """
    import cv2
    import numpy as np

    try:
        data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise ConfigError('', str(file), f'a readable picture ({error.strerror})') from error
    found = None
    if data.size:
        try:
            found = cv2.imdecode(data, cv2.IMREAD_COLOR)
        except cv2.error:
            found = None
    if found is None:
        raise ConfigError('', str(file), 'a picture: PNG, JPEG, BMP, TIFF or PNM')
    return np.asarray(found, dtype=np.uint8)


def fit_boards(files: 'list[Path]', board: 'Board', progress: 'Progress') -> 'LensFit':
    """Return the lens from pictures of a board; says in which pictures there is none."""
    from tablerunner.vision.calibration import find_board, fit_lens

    corners, size = [], None
    for number, file in enumerate(files):
        progress.show(f'picture {number + 1} of {len(files)}: {file}')
        picture = read_picture(file)
        own = (picture.shape[1], picture.shape[0])
        if size is not None and own != size:
            raise ConfigError(
                str(file), f'{own[0]} x {own[1]}', f'pictures of one size, {size[0]} x {size[1]}'
            )
        size = own
        found = find_board(picture, board)
        if found is None:
            progress.say(
                f'{file}: no board of {board.columns} x {board.rows} inner corners', 'yellow'
            )
        else:
            corners.append(found)
    try:
        return fit_lens(corners, board, size or (0, 0))
    except GeometryError as error:
        raise ConfigError('PICTURE', f'{len(files)} files', f'a calibration ({error})') from error


def fit_place(lens: 'Lens', marked: 'PointsFile', file: Optional[Path]) -> 'Optional[MountFit]':
    """Return the camera's pose from the marked points; None where there are none."""
    from tablerunner.vision.calibration import fit_mount

    if not marked.points:
        return None
    try:
        return fit_mount(
            lens,
            [item.pixel for item in marked.points],
            [item.place for item in marked.points],
        )
    except GeometryError as error:
        raise ConfigError(
            'points', f'{len(marked.points)} points', f'points of one camera ({error})', str(file)
        ) from error


def fit_colours(
    lens: 'Lens', marked: 'PointsFile', file: Optional[Path], source: Optional[Path]
) -> 'dict[str, ColourFit]':
    """Return the colour of each marked marker."""
    from tablerunner.vision.calibration import fit_colour

    if not marked.markers or file is None:
        return {}
    picture = read_picture(file)
    if picture.shape[:2] != (lens.height, lens.width):
        raise ConfigError(
            '--picture',
            f'{picture.shape[1]} x {picture.shape[0]}',
            f'a picture of the lens, {lens.width} x {lens.height}',
            'options',
        )
    found = {}
    for index, marker in enumerate(marked.markers):
        try:
            found[marker.robot] = fit_colour(picture, marker.pixels)
        except GeometryError as error:
            raise ConfigError(
                f'markers[{index}]', marker.robot, f'one clear colour ({error})', str(source)
            ) from error
    return found


def report(
    lens: 'Lens',
    fit: 'Optional[LensFit]',
    mount: 'Optional[MountFit]',
    colours: 'dict[str, ColourFit]',
) -> list[str]:
    """Return what was found, in words."""
    lines = []
    if fit is not None:
        lines += [
            f'lens: {len(fit.corners)} pictures, residuals {fit.rms_px:.3f} pixel (rms), corners '
            f'in {100 * fit.covered:.0f} % of the picture',
            f'  focal length {lens.focal[0]:.2f} +- {fit.focal_std[0]:.2f}, '
            f'{lens.focal[1]:.2f} +- {fit.focal_std[1]:.2f} pixel',
            f'  centre {lens.centre[0]:.2f} +- {fit.centre_std[0]:.2f}, '
            f'{lens.centre[1]:.2f} +- {fit.centre_std[1]:.2f} pixel',
            '  distortion ' + ', '.join(f'{value:.5f}' for value in lens.distortion),
        ]
        if fit.covered < 0.6:
            lines.append('  the distortion near the border is a guess: show the board there too')
    if mount is not None:
        place, angles = mount.mount.position, (mount.mount.yaw, *mount.mount.tilt)
        lines.append(
            f'place: {len(mount.residuals)} points, residuals {mount.rms_px:.2f} pixel (rms)'
        )
        lines += [
            f'  {name} {value:.4f} +- {std:.4f} {unit}'
            for name, value, std, unit in zip(
                ('x', 'y', 'height', 'yaw', 'tilt about x', 'tilt about y'),
                (*place, *angles),
                (*mount.position_std, *mount.angle_std),
                ('m', 'm', 'm', 'rad', 'rad', 'rad'),
                strict=True,
            )
        ]
    lines += [
        f'colour of {robot}: hue {fit_.hue:.0f} +- {fit_.hue_tolerance:.0f} degrees, saturation '
        f'from {fit_.least_saturation:.2f}, brightness from {fit_.least_value:.2f}'
        for robot, fit_ in colours.items()
    ]
    return lines


def figures(
    lens: 'Lens',
    fit: 'Optional[LensFit]',
    mount: 'Optional[MountFit]',
    colours: 'dict[str, ColourFit]',
) -> dict[str, Any]:
    """Return what was found, for JSON."""
    from dataclasses import asdict

    found: dict[str, Any] = {'lens': asdict(lens), 'colours': {}}
    if fit is not None:
        found['boards'] = {
            'pictures': len(fit.corners),
            'rms_px': fit.rms_px,
            'focal_std': fit.focal_std,
            'centre_std': fit.centre_std,
            'covered': fit.covered,
        }
    if mount is not None:
        found['mount'] = {
            'position': mount.mount.position,
            'yaw': mount.mount.yaw,
            'tilt': mount.mount.tilt,
            'rms_px': mount.rms_px,
            'position_std': mount.position_std,
            'angle_std': mount.angle_std,
            'residuals_px': mount.residuals.tolist(),
        }
    found['colours'] = {robot: asdict(item) for robot, item in colours.items()}
    return found


def node_text(
    marked: 'PointsFile',
    mount: 'Optional[MountFit]',
    colours: 'dict[str, ColourFit]',
    source: Optional[Path],
) -> str:
    """Return the lines of a parameter file that ceiling_camera reads.

    Raises
    ------
    ConfigError
        The node would refuse it: two markers of one colour.
    """
    import yaml

    from tablerunner.config import Document, build
    from tablerunner.vision import LocatorConfig

    own: dict[str, Any] = {}
    if mount is not None:
        own['mount'] = {
            'position': [round(value, 5) for value in mount.mount.position],
            'yaw': round(mount.mount.yaw, 6),
            'tilt': [round(value, 6) for value in mount.mount.tilt],
        }
    if colours:
        own['marker'] = {
            'robots': list(colours),
            'hues': [item.hue for item in colours.values()],
            'heights': [marker.height for marker in marked.markers],
            'hue_tolerance': max(item.hue_tolerance for item in colours.values()),
            'least_saturation': min(item.least_saturation for item in colours.values()),
            'least_value': min(item.least_value for item in colours.values()),
        }
    if not own:
        return ''
    build(LocatorConfig, Document(own, f'{source}: what was marked'))
    return str(
        yaml.safe_dump(
            {'/**/ceiling_camera': {'ros__parameters': own}},
            sort_keys=False,
            default_flow_style=None,
        )
    )


def write_text(file: Path, text: str) -> None:
    """Write a file; its folder is made if need be."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding='utf-8')
    except OSError as error:
        raise ConfigError('', str(file), f'a file to write ({error.strerror})') from error
