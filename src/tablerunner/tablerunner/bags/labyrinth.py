"""The labyrinth recording of TU Chemnitz as a bag of contract topics.

A small differential drive in a labyrinth of 2.4 m x 2.4 m with a UWB anchor in each corner (Tim
Pfeifer, TU Chemnitz, CC BY-SA 4.0; docs/datasets.md). Its text files hold one measurement a line:
ranges, wheel speeds and the true position, all at 7.8 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.writer import STORAGES, BagWriter
from tablerunner.errors import BagError, ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT
from tablerunner.types import (
    UNKNOWN_YAW_VARIANCE,
    Anchor,
    OdometrySample,
    RangeSample,
    WheelSample,
    nanoseconds,
    seconds,
)

INPUT_FILE = 'Indoor_UWB_Input.txt'
TRUTH_FILE = 'Indoor_UWB_GT.txt'
SCENARIO_FILE = 'scenario.yaml'
"""Description of robot and anchors that is put into the bag's folder."""

TAG_ID = 'tag'
WHEEL_RADIUS_M = 0.05
"""Nominal: the recording has wheel speeds in m/s, so that any radius serves; the scenario file
that is written beside the bag names the same one."""

_UNKNOWN_SPEED_VARIANCE = 1e6
_PLACE_TOLERANCE_M = 1e-9


@dataclass(frozen=True, slots=True)
class WheelSpeeds:
    """Speeds of both wheels on the ground at one time."""

    stamp: int
    left_m_s: float
    right_m_s: float


@dataclass(frozen=True, slots=True)
class TruePosition:
    """Where the robot was."""

    stamp: int
    x: float
    y: float


@dataclass(frozen=True)
class LabyrinthData:
    """What the text files hold, in SI units.

    Attributes
    ----------
    ranges : tuple of RangeSample
        From the tag, which is taken to be at the robot's centre, to anchors in its plane.
    speeds : tuple of WheelSpeeds
        Corrected: the columns are left then right (the source's readme has them the other way).
    truth : tuple of TruePosition
        Without heading.
    anchors : tuple of Anchor
        In order of their numbers.
    track : float
        Distance between the wheels [m]: twice the file's column, which is the half.
    """

    ranges: tuple[RangeSample, ...]
    speeds: tuple[WheelSpeeds, ...]
    truth: tuple[TruePosition, ...]
    anchors: tuple[Anchor, ...]
    track: float

    def wheels(self, radius: float = WHEEL_RADIUS_M) -> Iterator[WheelSample]:
        """Yield what encoders would have said: the speeds integrated by the trapezoid rule."""
        left = right = 0.0
        before: WheelSpeeds | None = None
        for item in self.speeds:
            if before is not None:
                half = 0.5 * seconds(item.stamp - before.stamp) / radius
                left += half * (before.left_m_s + item.left_m_s)
                right += half * (before.right_m_s + item.right_m_s)
            yield WheelSample(
                item.stamp, left, right, item.left_m_s / radius, item.right_m_s / radius
            )
            before = item


def read_labyrinth(folder: Path) -> LabyrinthData:
    """Read the recording's text files.

    Parameters
    ----------
    folder : Path
        Holds `INPUT_FILE` and `TRUTH_FILE`.

    Raises
    ------
    ConfigError
        A file is missing or a line is malformed; with file and line.
    """
    ranges: list[RangeSample] = []
    speeds: list[WheelSpeeds] = []
    anchors: dict[str, Anchor] = {}
    half_track = 0.0
    for line in _lines(folder / INPUT_FILE, {'range2': 8, 'odom2diff': 9}):
        if line.kind == 'range2':
            anchor = line.anchor()
            if anchors.setdefault(anchor.anchor_id, anchor) != anchor:
                raise line.error('position', anchor.position, 'where the anchor was before')
            ranges.append(line.range(len(ranges), ranges[-1].stamp if ranges else 0))
        else:
            half_track = line.half_track(half_track)
            speeds.append(
                WheelSpeeds(
                    line.stamp(speeds[-1].stamp if speeds else 0),
                    line.number(2, 'left wheel speed'),
                    line.number(3, 'right wheel speed'),
                )
            )
    truth: list[TruePosition] = []
    for line in _lines(folder / TRUTH_FILE, {'point2': 8}):
        stamp = line.stamp(truth[-1].stamp if truth else 0)
        truth.append(TruePosition(stamp, line.number(2, 'x'), line.number(3, 'y')))
    for name, found in (('range2', ranges), ('odom2diff', speeds)):
        if not found:
            raise ConfigError(name, 'no line', 'at least one', str(folder / INPUT_FILE))
    places = tuple(anchors[key] for key in sorted(anchors))
    return LabyrinthData(tuple(ranges), tuple(speeds), tuple(truth), places, 2.0 * half_track)


def convert_labyrinth(source: Path, target: Path, storage: str = STORAGES[0]) -> LabyrinthData:
    """Write the recording as a bag of contract topics, with a scenario file in its folder.

    Topics: joint_states, uwb/ranges (as measured, not calibrated), uwb/anchors and ground_truth.
    Stamps are the recording's own, which begin near zero; at equal stamps the wheels come first.

    Parameters
    ----------
    source : Path
        Folder of the text files.
    target : Path
        Folder of the bag; it must not exist.
    storage : str
        One of `STORAGES`.

    Raises
    ------
    ConfigError
        As for `read_labyrinth`.
    BagError
        The bag cannot be written.
    """
    data = read_labyrinth(source)
    with BagWriter(target, storage) as bag:
        for topic in ('uwb/anchors', 'joint_states', 'uwb/ranges', 'ground_truth'):
            bag.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
        first = min(data.ranges[0].stamp, data.speeds[0].stamp)
        bag.write('uwb/anchors', first, messages.anchors_message(data.anchors, first, 'map'))
        for _, _, topic, stamp, message in sorted(_messages(data), key=lambda item: item[:2]):
            bag.write(topic, stamp, message)
    try:
        (target / SCENARIO_FILE).write_text(scenario_text(data), encoding='utf-8')
    except OSError as error:
        raise BagError(f'{target / SCENARIO_FILE} cannot be written: {error.strerror}') from error
    return data


def scenario_text(data: LabyrinthData) -> str:
    """Return the scenario file that describes robot and anchors of the recording."""
    content = {
        'name': 'labyrinth',
        'tag_id': TAG_ID,
        'anchors': [
            {'id': anchor.anchor_id, 'position': list(anchor.position)} for anchor in data.anchors
        ],
        'robot': {
            'wheel_radius': WHEEL_RADIUS_M,
            'track': data.track,
            'footprint_radius': 0.1,
            'tag_position': [0.0, 0.0, 0.0],
            'ultrasonics': [],
        },
    }
    head = (
        '# Robot and anchors of the labyrinth (Tim Pfeifer, TU Chemnitz, CC BY-SA 4.0).\n'
        '# The recording is flat: tag and anchors are taken to be at one height. The radius of\n'
        '# the wheels is nominal, the heading at the start is not known.\n'
    )
    return head + yaml.safe_dump(content, sort_keys=False, default_flow_style=None)


def _messages(data: LabyrinthData) -> Iterator[tuple[int, int, str, int, object]]:
    """Yield (stamp, rank at equal stamps, topic, stamp, message) of each measurement."""
    for wheels in data.wheels():
        message = messages.wheels_message(wheels, LEFT_JOINT, RIGHT_JOINT)
        yield wheels.stamp, 0, 'joint_states', wheels.stamp, message
    for sample in data.ranges:
        message = messages.range_message(sample, 'uwb_tag')
        yield sample.stamp, 1, 'uwb/ranges', sample.stamp, message
    for point in data.truth:
        # The source gives no covariance (zeros), no heading and no speed.
        truth = OdometrySample(
            point.stamp,
            Pose2(point.x, point.y, 0.0),
            0.0,
            0.0,
            np.diag([0.0, 0.0, UNKNOWN_YAW_VARIANCE]),
            np.eye(2) * _UNKNOWN_SPEED_VARIANCE,
        )
        message = messages.odometry_message(truth, 'map', 'base_link')
        yield point.stamp, 2, 'ground_truth', point.stamp, message


@dataclass(frozen=True, slots=True)
class _Line:
    """One line of a text file, with its place for messages."""

    source: str
    line: int
    kind: str
    words: tuple[str, ...]

    def error(self, field: str, value: object, expected: str) -> ConfigError:
        return ConfigError(field, value, expected, self.source, self.line)

    def number(self, column: int, name: str) -> float:
        try:
            value = float(self.words[column])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(name, self.words[column], 'a finite number')
        return value

    def stamp(self, before: int) -> int:
        value = nanoseconds(self.number(1, 'time stamp'))
        if value <= before:
            raise self.error('time stamp', self.words[1], 'a later time than the line before')
        return value

    def anchor(self) -> Anchor:
        if not self.words[6].isdigit():
            raise self.error('UWB module ID', self.words[6], 'a whole number')
        place = (self.number(4, 'position X'), self.number(5, 'position Y'), 0.0)
        return Anchor(self.words[6], place)

    def range(self, sequence: int, before: int) -> RangeSample:
        distance = self.number(2, 'range mean')
        variance = self.number(3, 'range covariance')
        if distance < 0.0:
            raise self.error('range mean', distance, 'at least 0 [m]')
        if variance <= 0.0:
            raise self.error('range covariance', variance, 'above 0 [m^2]')
        return RangeSample(
            self.stamp(before), self.words[6], TAG_ID, sequence, distance, variance, distance
        )

    def half_track(self, before: float) -> float:
        value = self.number(5, 'half the distance between the wheels')
        if value <= 0.0 or (before and abs(value - before) > _PLACE_TOLERANCE_M):
            expected = f'{before} as before [m]' if before else 'above 0 [m]'
            raise self.error('half the distance between the wheels', value, expected)
        return value


def _lines(file: Path, kinds: dict[str, int]) -> Iterator[_Line]:
    """Yield the lines of a file; `kinds` has the number of words of each kind of line."""
    try:
        text = file.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError('', str(file), f'a readable text file ({error})', str(file)) from error
    for number, row in enumerate(text.splitlines(), start=1):
        words = tuple(row.split())
        if not words:
            continue
        line = _Line(str(file), number, words[0], words)
        if words[0] not in kinds:
            raise line.error('', words[0], 'one of ' + ', '.join(kinds))
        if len(words) != kinds[words[0]]:
            raise line.error(words[0], f'{len(words)} columns', f'{kinds[words[0]]}')
        yield line
