"""The converter of the labyrinth recording, against the text files read another way."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from tablerunner.bags.labyrinth import (
    INPUT_FILE,
    TRUTH_FILE,
    WHEEL_RADIUS_M,
    convert_labyrinth,
    read_labyrinth,
)
from tablerunner.bags.reader import BagReader
from tablerunner.bags.writer import STORAGES
from tablerunner.errors import BagError, ConfigError
from tablerunner.scenario import load_scenario
from tablerunner.types import UNKNOWN_YAW_VARIANCE

INPUT = """\
range2 0.1 1.5 0.01 0.0 0.0 105 0
range2 0.2 2.5 0.01 2.0 0.0 107 0
range2 0.3 1.4 0.01 0.0 0.0 105 0
odom2diff 0.1 0.2 0.4 0 0.08 0.0001 0.0001 0.0001
odom2diff 0.3 0.4 0.4 0 0.08 0.0001 0.0001 0.0001
"""
TRUTH = 'point2 0.1 1.0 2.0 0 0 0 0\npoint2 0.3 1.1 2.0 0 0 0 0\n'


def write_source(folder: Path, text: str = INPUT, truth: str = TRUTH) -> Path:
    """Write the text files of a recording."""
    (folder / INPUT_FILE).write_text(text)
    (folder / TRUTH_FILE).write_text(truth)
    return folder


def table(file: Path, kind: str) -> np.ndarray:
    """Return the numbers of all lines of a kind, read by a pattern alone."""
    rows = re.findall(rf'^{kind}\s+(.*?)\s*$', file.read_text(), flags=re.MULTILINE)
    return np.array([[float(word) for word in row.split()] for row in rows])


@pytest.mark.parametrize('storage', STORAGES)
def test_convert_labyrinth_bag_holds_the_numbers_of_the_files(
    labyrinth_folder: Path, tmp_path: Path, storage: str
) -> None:
    convert_labyrinth(labyrinth_folder, tmp_path / 'bag', storage)
    ranges = table(labyrinth_folder / INPUT_FILE, 'range2')
    speeds = table(labyrinth_folder / INPUT_FILE, 'odom2diff')
    truth = table(labyrinth_folder / TRUTH_FILE, 'point2')
    with BagReader(tmp_path / 'bag') as bag:
        found: dict[str, list[object]] = {topic.name: [] for topic in bag.topics}
        for item in bag.messages():
            found[item.topic].append(item.message)
            if item.topic != '/uwb/anchors':
                stamp = item.message.header.stamp
                assert item.stamp == stamp.sec * 10**9 + stamp.nanosec
        assert bag.damage == ()
    times = np.array(
        [
            message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            for message in found['/uwb/ranges']
        ]
    )
    np.testing.assert_allclose(times, ranges[:, 0], atol=1e-9)
    np.testing.assert_array_equal(
        [(message.range, message.variance) for message in found['/uwb/ranges']], ranges[:, 1:3]
    )
    assert [int(message.anchor_id) for message in found['/uwb/ranges']] == list(ranges[:, 5])
    anchors = {anchor.anchor_id: anchor.position for anchor in found['/uwb/anchors'][0].anchors}
    for row in ranges:
        place = anchors[str(int(row[5]))]
        assert (place.x, place.y) == (row[3], row[4])
    angles = np.array([message.position for message in found['/joint_states']])
    dt = np.diff(speeds[:, 0])[:, None]
    step = 0.5 * dt * (speeds[1:, 1:3] + speeds[:-1, 1:3]) / WHEEL_RADIUS_M
    np.testing.assert_allclose(angles[1:], np.cumsum(step, axis=0), atol=1e-7)
    np.testing.assert_allclose(
        [message.velocity for message in found['/joint_states']], speeds[:, 1:3] / WHEEL_RADIUS_M
    )
    assert found['/joint_states'][0].name == ['left_wheel_joint', 'right_wheel_joint']
    for message, row in zip(found['/ground_truth'], truth, strict=True):
        assert (message.pose.pose.position.x, message.pose.pose.position.y) == (row[1], row[2])
        assert np.isfinite(message.pose.covariance).all()
        assert message.pose.covariance[35] == UNKNOWN_YAW_VARIANCE


def test_convert_labyrinth_first_column_of_speeds_is_the_left_wheel(tmp_path: Path) -> None:
    """The source's readme has left and right the wrong way round: with 0.2 m/s left and
    0.4 m/s right the robot turns to the left.
    """
    wheels = list(read_labyrinth(write_source(tmp_path)).wheels(0.1))
    assert wheels[0].left_speed_rad_s == pytest.approx(2.0)
    assert wheels[0].right_speed_rad_s == pytest.approx(4.0)
    assert wheels[1].left_angle_rad == pytest.approx(0.2 * 3.0)
    assert wheels[1].right_angle_rad == pytest.approx(0.2 * 4.0)


def test_convert_labyrinth_scenario_describes_the_robot(tmp_path: Path) -> None:
    data = convert_labyrinth(write_source(tmp_path), tmp_path / 'bag')
    scenario = load_scenario(tmp_path / 'bag' / 'scenario.yaml')
    assert data.track == scenario.robot.track == 0.16
    assert scenario.robot.wheel_radius == WHEEL_RADIUS_M
    assert scenario.robot.tag_position == (0.0, 0.0, 0.0)
    assert [(place.id, place.position) for place in scenario.anchors] == [
        ('105', (0.0, 0.0, 0.0)),
        ('107', (2.0, 0.0, 0.0)),
    ]
    assert not math.isnan(data.ranges[0].raw_range_m)


@pytest.mark.parametrize(
    ('old', 'new', 'expected'),
    [
        ('range2 0.2 2.5', 'range2 0.2 x', r'Input.txt:2: range mean: got .x.'),
        ('range2 0.2 2.5', 'range2 0.2 nan', r'Input.txt:2: range mean: got .nan.'),
        ('range2 0.2 2.5', 'range2 0.2 -2.5', r'Input.txt:2: range mean: got -2.5, .* at least 0'),
        ('range2 0.2 2.5 0.01', 'range2 0.2 2.5 0', r'txt:2: range covariance.*above 0'),
        ('range2 0.2', 'range2 0.1', r'txt:2: time stamp: got .0.1., expected a later time'),
        ('range2 0.1', 'range2 0.0', r'txt:1: time stamp'),
        (' 107 0', ' a107 0', r'txt:2: UWB module ID'),
        (' 107 0', ' 107', r'txt:2: range2: got .7 columns., expected 8'),
        ('range2 0.3 1.4 0.01 0.0', 'range2 0.3 1.4 0.01 0.5', r'txt:3: position.*was before'),
        ('odom2diff 0.1 0.2', 'odom2diff 0.1 inf', r'txt:4: left wheel speed'),
        ('0.3 0.4 0.4 0 0.08', '0.3 0.4 0.4 0 0.09', r'txt:5: half the distance.*0.08 as before'),
        ('0.1 0.2 0.4 0 0.08', '0.1 0.2 0.4 0 -0.08', r'txt:4: half the distance.*above 0'),
        ('range2 0.1', 'range9 0.1', r'txt:1: got .range9., expected one of range2, odom2diff'),
    ],
)
def test_read_labyrinth_malformed_line_names_file_and_line(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    write_source(tmp_path, INPUT.replace(old, new, 1))
    with pytest.raises(ConfigError, match=expected):
        read_labyrinth(tmp_path)


def test_read_labyrinth_malformed_truth_names_file_and_line(tmp_path: Path) -> None:
    write_source(tmp_path, truth=TRUTH.replace('1.1', 'one'))
    with pytest.raises(ConfigError, match=r'GT.txt:2: x: got .one.'):
        read_labyrinth(tmp_path)


def test_read_labyrinth_missing_parts_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'Input.txt.*a readable text file'):
        read_labyrinth(tmp_path)
    write_source(tmp_path, INPUT[: INPUT.index('odom2diff')])
    with pytest.raises(ConfigError, match=r'odom2diff: got .no line.'):
        read_labyrinth(tmp_path)


def test_convert_labyrinth_malformed_source_leaves_no_bag(tmp_path: Path) -> None:
    write_source(tmp_path, INPUT.replace('2.5', 'x'))
    with pytest.raises(ConfigError):
        convert_labyrinth(tmp_path, tmp_path / 'bag')
    assert not (tmp_path / 'bag').exists()


def test_convert_labyrinth_existing_target_raises(tmp_path: Path) -> None:
    write_source(tmp_path)
    with pytest.raises(BagError, match='never written over'):
        convert_labyrinth(tmp_path, tmp_path)
