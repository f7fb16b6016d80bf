"""`survey-anchors` and `calibrate wheels` on bags: what they write, and bad input."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.drives import read_drive
from tablerunner.bags.labyrinth import convert_labyrinth
from tablerunner.bags.reader import BagReader
from tablerunner.bags.writer import BagWriter
from tablerunner.cli.main import main
from tablerunner.config import Document, build
from tablerunner.odometry import OdometerConfig
from tablerunner.odometry.wheels import WheelsConfig
from tablerunner.scenario import Scenario, WheelErrors, load_scenario
from tablerunner.types import RangeSample
from tablerunner.uwb import RangerConfig

LEFT, RIGHT = 0.02, -0.01


@pytest.fixture(scope='module')
def drive(
    make_bag: Callable[..., Path], restaurant: Scenario, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return a bag of a minute in the restaurant, with wheels that are off by a known share."""
    wheels = WheelErrors(
        radius_scale_std=0.0, track_scale_std=0.0, radius_scale=(LEFT, RIGHT), slip_rate=0.0
    )
    room = replace(restaurant, sensors=replace(restaurant.sensors, wheels=wheels))
    return make_bag(tmp_path_factory.mktemp('survey') / 'bag', room, 5, 60.0)


@pytest.fixture(scope='module')
def labyrinth(labyrinth_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the labyrinth recording as a bag."""
    target = tmp_path_factory.mktemp('labyrinth') / 'bag'
    convert_labyrinth(labyrinth_folder, target)
    return target


def given(room: Scenario, count: int = 2) -> list[str]:
    places = [(item.id, item.position) for item in room.anchors[:count]]
    return [word for name, (x, y, _) in places for word in ('--at', f'{name}={x},{y}')]


def test_anchors_come_out_and_are_read_by_node_and_replay(
    drive: Path, restaurant: Scenario, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Blocked lines, biases of 7 cm and scales of 0.5 %: errors within four stated deviations."""
    room = tmp_path / 'room.yaml'
    anchors = [{'id': i.id, 'position': list(i.position)} for i in restaurant.anchors]
    tag = list(restaurant.robot.tag_position)
    room.write_text(
        yaml.safe_dump({'name': 'r', 'anchors': anchors, 'robot': {'tag_position': tag}})
    )
    output, figures = tmp_path / 'out', tmp_path / 'x.json'
    arguments = [*given(restaurant), '--height', str(restaurant.anchors[0].position[2])]
    arguments += ['--scenario', str(room), '--json', str(figures)]
    assert main(['survey-anchors', str(drive), *arguments, '-o', str(output)]) == 0
    assert 'against the places that were told' in capsys.readouterr().out
    own = yaml.safe_load((output / 'uwb_driver.yaml').read_text())['/**/uwb_driver']
    config = build(RangerConfig, Document(own['ros__parameters'], 'x'))
    surveyed = load_scenario(output / 'scenario.yaml')
    told = json.loads(figures.read_text())
    by_name = {item['id']: item for item in told['anchors']}
    assert config.anchor_ids == tuple(sorted(item.id for item in restaurant.anchors))
    assert (output / 'survey.png').read_bytes().startswith(b'\x89PNG')
    for place in restaurant.anchors:
        item = by_name[place.id]
        error = np.abs(np.subtract(item['position'], place.position))
        assert np.all(error <= 4.0 * np.array(item['std']) + 1e-9), place.id
        written = next(a.position for a in surveyed.anchors if a.id == place.id)
        np.testing.assert_allclose(written, item['position'], atol=1e-4)
    assert told['against_told_m'] < 0.25
    # What is there is not overwritten.
    assert main(['survey-anchors', str(drive), *arguments, '-o', str(output)]) == 2
    assert 'does not exist yet' in capsys.readouterr().err


def test_wheels_come_out_and_are_read_by_the_node(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, figures = tmp_path / 'odom.yaml', tmp_path / 'x.json'
    assert (
        main(['calibrate', 'wheels', str(drive), '-o', str(output), '--json', str(figures)]) == 0
    )
    told = json.loads(figures.read_text())
    true = np.array([0.06 * (1.0 + LEFT), 0.06 * (1.0 + RIGHT), 0.34])
    found = np.array([told['left_radius_m'], told['right_radius_m'], told['track_m']])
    assert np.all(np.abs(found - true) < 4.0 * np.array(told['std_m']))
    assert told['difference'] == pytest.approx(RIGHT - LEFT, abs=0.003)
    own = yaml.safe_load(output.read_text())['/**/odom_node']['ros__parameters']['wheels']
    radii = [own['wheel_radius'] * own[f'{side}_radius_multiplier'] for side in ('left', 'right')]
    np.testing.assert_allclose(radii, found[:2], rtol=1e-5)
    two = {name: own[name] for name in ('wheel_radius', 'track')}
    assert build(WheelsConfig, Document(two, 'x')).track == own['track']
    assert output.with_suffix('.png').read_bytes().startswith(b'\x89PNG')
    assert 'gyroscope' in capsys.readouterr().out


def test_labyrinth_anchors_are_within_a_quarter_of_a_metre(
    labyrinth: Path, tmp_path: Path
) -> None:
    """9.3 m of a real robot without a gyroscope; the place of the start is not known."""
    figures = tmp_path / 'x.json'
    arguments = ['survey-anchors', str(labyrinth), '--height', '0', '--json', str(figures)]
    assert main([*arguments, '-o', str(tmp_path / 'free')]) == 0
    assert json.loads(figures.read_text())['against_told_moved_m'] < 0.25
    arguments += ['--at', '105=-0.02,-0.01', '--at', '109=2.385,-0.005']
    assert main([*arguments, '-o', str(tmp_path / 'given')]) == 0
    assert json.loads(figures.read_text())['against_told_m'] < 0.25


def rewritten(
    source: Path, target: Path, topics: set[str], change: Callable = lambda m: [m]
) -> Path:
    """Copy some topics of a bag."""
    with BagReader(source) as reader, BagWriter(target) as writer:
        for topic in topics:
            writer.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
        for topic, received, _, original in reader.messages([f'/{name}' for name in topics]):
            for message in change(original):
                writer.write(topic, received, message)
    return target


def test_joints_of_other_names_are_told_by_the_parameter_file_of_the_robot(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoilt = False

    def renamed(message: object) -> list[object]:
        nonlocal spoilt
        if hasattr(message, 'name'):
            message.name = [name.replace('wheel_joint', 'motor') for name in message.name]
        elif hasattr(message, 'angular_velocity') and not spoilt:
            spoilt = True  # what is refused of another topic tells nothing of the wheels
            message.angular_velocity.z = math.nan
        return [message]

    topics = {'joint_states', 'imu/data', 'uwb/exchanges', 'uwb/anchors'}
    bag = rewritten(drive, tmp_path / 'bag', topics, renamed)
    robot, found = tmp_path / 'robot.yaml', []
    joints = {'left_joints': ['left_motor'], 'right_joints': ['right_motor']}
    robot.write_text(yaml.safe_dump({'odom_node': {'ros__parameters': joints}}))
    plain = ['calibrate', 'wheels', str(drive), '-o', str(tmp_path / 'plain.yaml')]
    command = ['calibrate', 'wheels', str(bag), '-o', str(tmp_path / 'odom.yaml')]
    for number, call in enumerate((plain, [*command, '--params', str(robot)])):
        figures = tmp_path / f'{number}.json'
        assert main([*call, '--json', str(figures)]) == 0
        found.append(json.loads(figures.read_text())['left_radius_m'])
    assert found[1] == pytest.approx(found[0], rel=1e-3)  # one sample of the gyroscope less
    capsys.readouterr()
    for command in (['calibrate', 'wheels'], ['survey-anchors']):
        assert main([*command, str(bag), '-o', str(tmp_path / 'other.yaml')]) == 2
        told = capsys.readouterr().err
        assert 'of other joints (expected are left_wheel_joint, right_wheel_joint)' in told
    command = ['survey-anchors', str(bag), '--height', '2.25', '--params', str(robot)]
    assert main([*command, '-o', str(tmp_path / 'survey')]) == 0


@pytest.mark.parametrize(
    ('topics', 'words'),
    [
        ({'uwb/exchanges'}, 'neither joint_states nor odom'),
        ({'joint_states', 'imu/data'}, 'neither uwb/exchanges nor uwb/ranges'),
    ],
)
@pytest.mark.parametrize('command', [('survey-anchors',), ('calibrate', 'wheels')])
def test_a_bag_that_lacks_a_part_is_named(
    drive: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    topics: set[str],
    words: str,
    command: tuple[str, ...],
) -> None:
    bag = rewritten(drive, tmp_path / 'part', topics)
    assert main([*command, str(bag), '-o', str(tmp_path / 'x.yaml')]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--at', 'A0=0'], '--at'),
        (['--at', '=0,0'], '--at'),
        (['--at', 'A0=0,nan'], '--at'),
        (['--height', 'A0='], '--height'),
        (['--height', '2', '--height', '3'], '--height'),
        (['--start', '1,2'], '--start'),
        (['--start', '1,2,0', '--at', 'A0=0,0'], 'either --start or --at'),
        (['--at', 'X1=0,0', '--at', 'X2=1,0'], 'X1'),
    ],
)
def test_bad_options_are_named(
    drive: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    assert main(['survey-anchors', str(drive), *arguments, '-o', str(tmp_path / 'x')]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / 'x').exists()


def test_ranges_between_anchors_and_those_of_the_tag_are_told_apart(
    labyrinth: Path, tmp_path: Path
) -> None:
    """Every tenth range is repeated as one between two anchors."""
    count = 0

    def with_links(message: object) -> list[object]:
        nonlocal count
        count += 1
        if not hasattr(message, 'anchor_id') or count % 10:
            return [message]
        link = RangeSample(count * 1000, '107', '105', count, 2.37, 0.01, 2.4)
        return [message, messages.range_message(link, 'uwb_tag')]

    bag = rewritten(labyrinth, tmp_path / 'bag', {'joint_states', 'uwb/ranges'}, with_links)
    with BagReader(bag) as reader:
        raw = read_drive(reader, OdometerConfig())
        plain = read_drive(reader, OdometerConfig(), raw=False)
    assert set(raw.links) == {('105', '107')}
    assert len(raw.ranges.stamps) == 233
    assert set(raw.links['105', '107']) == {2.4}
    assert set(plain.links['105', '107']) == {2.37}
    assert raw.wheels is not None
    assert raw.wheels.gyro is None
    assert any('wheels alone' in note for note in raw.notes)
