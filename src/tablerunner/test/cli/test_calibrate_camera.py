"""`tablerunner calibrate camera`: from pictures to what driver and node read; bad input."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from tablerunner.cli.main import main
from tablerunner.config import Document, build
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Marker, RobotGeometry, Scenario
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.types import ImageSample, Lens
from tablerunner.vision import CeilingLocator, LocatorConfig
from tablerunner.vision.camera_file import lens_text, read_lens

POSE = Pose2(0.4, 0.2, 0.9)
MARKER = Marker((30, 190, 60))


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lay out a room with a camera, its lens, points clicked to half a pixel, and a picture."""
    path = tmp_path_factory.mktemp('camera')
    camera = Camera(
        (0.3, -0.2, 3.3),
        0.4,
        (0.05, -0.1),
        width=320,
        height=240,
        focal=(230.0, 230.0),
        position_std=0.0,
        angle_std=0.0,
        focal_std=0.0,
    )
    view = CeilingView(Scenario('x', camera=camera, robot=RobotGeometry(marker=MARKER)), 1)
    picture = view.draw(0.0, [RobotView(POSE, 0.25, MARKER)])
    cv2.imwrite(str(path / 'room.png'), picture)
    lens = Lens(320, 240, camera.focal, camera.middle, camera.distortion)
    (path / 'lens.yaml').write_text(lens_text(lens, 'x'))
    rng = np.random.default_rng(0)
    places = np.column_stack([rng.uniform(-1.2, 1.5, (9, 2)), rng.uniform(0.0, 1.0, 9)])
    clicks = view.rays.project(places) + rng.normal(0.0, 0.3, (9, 2))
    discs = [POSE @ Pose2(x) for x in (MARKER.disc_x, MARKER.front_x)]
    on_discs = view.rays.project(np.array([(p.x, p.y, MARKER.height) for p in discs]))
    content = {
        'points': [
            {'pixel': click.round(1).tolist(), 'place': place.round(4).tolist()}
            for click, place in zip(clicks, places, strict=True)
        ],
        'markers': [
            {'robot': 'one', 'height': MARKER.height, 'pixels': on_discs.round(1).tolist()}
        ],
    }
    (path / 'points.yaml').write_text(yaml.safe_dump(content))
    return path


def calibrate(folder: Path, output: Path, *more: str) -> int:
    return main(
        [
            'calibrate',
            'camera',
            '--camera-info',
            str(folder / 'lens.yaml'),
            '--points',
            str(folder / 'points.yaml'),
            '--picture',
            str(folder / 'room.png'),
            '-o',
            str(output),
            *more,
        ]
    )


def test_what_is_written_finds_the_robot(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lens and node file, read as driver and node do, see the robot where it stands."""
    output = tmp_path / 'out'
    assert calibrate(folder, output, '--json', str(tmp_path / 'x.json')) == 0
    assert 'place: 9 points' in capsys.readouterr().out
    assert json.loads((tmp_path / 'x.json').read_text())['mount']['rms_px'] < 0.6
    assert (output / 'calibration.png').stat().st_size > 10_000
    given = yaml.safe_load((output / 'ceiling_camera.yaml').read_text())
    own = given['/**/ceiling_camera']['ros__parameters']
    config = build(LocatorConfig, Document(own))
    locator = CeilingLocator(config, read_lens(output / 'camera_info.yaml'))
    (seen,) = locator.add(ImageSample(1, cv2.imread(str(folder / 'room.png'))))
    assert seen.robot == 'one'
    # Half a pixel of 9 clicks at 9 mm a pixel.
    assert seen.sample.pose.distance_to(POSE) < 0.01


def test_boards_give_the_lens(boards_folder: list[str], tmp_path: Path) -> None:
    output = tmp_path / 'out'
    arguments = ['calibrate', 'camera', *boards_folder, '--board', '7x5', '--square', '0.08']
    assert main([*arguments, '-o', str(output)]) == 0
    assert read_lens(output / 'camera_info.yaml').focal[0] == pytest.approx(260.0, rel=0.01)
    # What is there is not overwritten.
    assert main([*arguments, '-o', str(output)]) == 2


@pytest.fixture
def boards_folder(boards: list[np.ndarray], tmp_path: Path) -> list[str]:
    files = []
    for index, picture in enumerate(boards):
        files.append(str(tmp_path / f'{index}.png'))
        cv2.imwrite(files[-1], picture)
    return files


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda f: ['--board', '9by6'], '--board'),
        (lambda f: ['--square', '0'], '--square'),
        (lambda f: ['--picture', str(f / 'points.yaml')], 'a picture: PNG'),
        (lambda f: ['--picture', str(f / 'none.png')], 'a readable picture'),
        (lambda f: ['--points', str(f / 'lens.yaml')], 'image_width'),
        (lambda f: ['--camera-info', str(f / 'points.yaml')], 'a known field'),
        (lambda f: [str(f / 'room.png')], 'PICTURE'),
    ],
)
def test_bad_input_is_named_and_ends_with_2(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: object, words: str
) -> None:
    assert calibrate(folder, tmp_path / 'out', *change(folder)) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_pictures_without_boards_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    room = str(folder / 'room.png')
    assert main(['calibrate', 'camera', room, room, '-o', str(tmp_path / 'out')]) == 2
    error = capsys.readouterr().err
    assert 'no board of 9 x 6 inner corners' in error
    assert '0 pictures with a board' in error


@pytest.mark.parametrize(
    ('good', 'bad', 'words'),
    [
        ('robot: one', 'robot: ""', 'markers[0].robot'),
        ('height: 1.15', 'height: low', 'markers[0].height'),
        ('place:', 'plaice:', 'did you mean place?'),
    ],
)
def test_points_file_with_a_slip_is_named(
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    good: str,
    bad: str,
    words: str,
) -> None:
    text = (folder / 'points.yaml').read_text()
    assert good in text
    spoilt = tmp_path / 'points.yaml'
    spoilt.write_text(text.replace(good, bad, 1))
    assert calibrate(folder, tmp_path / 'out', '--points', str(spoilt)) == 2
    assert words in capsys.readouterr().err
