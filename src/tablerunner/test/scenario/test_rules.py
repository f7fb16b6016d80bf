"""Scenarios that cannot be are refused with file, line, field and value."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablerunner.errors import ConfigError
from tablerunner.scenario import load_scenario

GOOD = """\
name: cafe
walls:
  - name: hull
    closed: true
    points: [[0, 0], [10, 0], [10, 10], [0, 10]]
  - points: [[6, 0], [6, 3]]
tables:
  - {name: table_1, x: 3.0, y: 3.0, stop: [4.2, 3.0, 0.0]}
  - {name: table_2, x: 3.0, y: 7.0, stop: [4.2, 7.0, 0.0]}
boxes:
  - {name: stove, x: 9.0, y: 9.0, length: 1.0, width: 1.0}
kitchen:
  stop: [8.0, 6.0, 0.0]
anchors:
  - {id: A0, position: [0.1, 0.1, 2.25]}
  - {id: A1, position: [9.9, 0.1, 2.25]}
people:
  - {name: waiter, route: [[5.0, 1.0], [5.0, 9.0]]}
routes:
  tour: [[5.0, 5.0], [8.0, 5.0]]
robot:
  wheel_radius: 0.06
  marker: {height: 1.2}
camera:
  position: [5.0, 5.0, 3.0]
  light: {level: 1.0}
sensors:
  uwb: {range_std: 0.1}
"""


def load_text(folder: Path, text: str) -> None:
    path = folder / 'cafe.yaml'
    path.write_text(text, encoding='utf-8')
    load_scenario(path)


def test_rules_accept_the_scenario_that_the_others_spoil(tmp_path: Path) -> None:
    load_text(tmp_path, GOOD)


CASES = {
    # what: (good line, bad line, field, part of the message)
    'wrong type': ('x: 3.0, y: 3.0', 'x: three, y: 3.0', 'tables[0].x', 'a finite number'),
    'NaN': ('x: 3.0, y: 3.0', 'x: .nan, y: 3.0', 'tables[0].x', 'got nan'),
    'infinite height': ('9.9, 0.1, 2.25', '9.9, 0.1, .inf', 'anchors[1].position[2]', 'got inf'),
    'missing field': ('name: table_2, ', '', 'tables[1].name', "got 'nothing'"),
    'slip of a name': (
        'range_std',
        'range_sdt',
        'sensors.uwb.range_sdt',
        'did you mean range_std',
    ),
    'negative noise': ('range_std: 0.1', 'range_std: -0.1', 'sensors.uwb.range_std', 'at least 0'),
    'zero radius': ('wheel_radius: 0.06', 'wheel_radius: 0', 'robot.wheel_radius', 'above 0'),
    'wide track': ('wheel_radius: 0.06', 'track: 0.6', 'robot.track', 'twice footprint'),
    'duplicate anchor': ('id: A1', 'id: A0', 'anchors[1].id', 'each id once'),
    'anchors in one place': (
        '9.9, 0.1, 2.25',
        '0.1, 0.1, 2.25',
        'anchors[1].position',
        'another place than anchor A0',
    ),
    'duplicate table': ('table_2', 'table_1', 'tables[1].name', 'each name once'),
    'table called kitchen': ('table_2', 'kitchen', 'tables[1].name', 'than the kitchen'),
    'wall of zero length': (
        '[[6, 0], [6, 3]]',
        '[[6, 0], [6, 0]]',
        'walls[1].points[1]',
        'apart from the one before',
    ),
    'wall of one point': ('[[6, 0], [6, 3]]', '[[6, 0]]', 'walls[1].points', 'at least two'),
    'closing edge of zero length': (
        '[[0, 0], [10, 0], [10, 10], [0, 10]]',
        '[[0, 0], [10, 0], [10, 10], [0, 0]]',
        'walls[0].points[0]',
        'apart from',
    ),
    'table in a wall': ('x: 3.0, y: 3.0', 'x: 6.2, y: 2.0', 'tables[0]', 'clear of the wall'),
    'table outside': ('x: 3.0, y: 3.0', 'x: 13.0, y: 3.0', 'tables[0]', 'inside the outer walls'),
    'tables in each other': ('x: 3.0, y: 7.0', 'x: 3.3, y: 3.2', 'tables[1]', 'clear of table_1'),
    'table swallows box': ('x: 9.0, y: 9.0', 'x: 3.0, y: 7.0', 'boxes[0]', 'clear of table_2'),
    'stop in a table': ('[4.2, 3.0, 0.0]', '[3.0, 3.0, 0.0]', 'tables[0].stop', 'of table_1'),
    'stop too near': ('[4.2, 3.0, 0.0]', '[3.8, 3.0, 0.0]', 'tables[0].stop', 'at least 0.25 m'),
    'stop outside': ('[4.2, 3.0, 0.0]', '[14, 3.0, 0.0]', 'tables[0].stop', 'inside the outer'),
    'kitchen in a wall': ('[8.0, 6.0, 0.0]', '[6.1, 2.0, 0]', 'kitchen.stop', 'clear of wall'),
    'pose of two numbers': ('[8.0, 6.0, 0.0]', '[8.0, 6.0]', 'kitchen.stop', '3 values'),
    'person walks through table': (
        '[[5.0, 1.0], [5.0, 9.0]]',
        '[[3.0, 1.0], [3.0, 5.0]]',
        'people[0].route[1]',
        'clear of table_1',
    ),
    'loop closed twice': (
        'route: [[5.0, 1.0], [5.0, 9.0]]',
        'route: [[5.0, 1.0], [5.0, 9.0], [5.0, 1.0]], loop: true',
        'people[0].route[0]',
        'apart from the one before',
    ),
    'person without a way': ('[[5.0, 1.0], [5.0, 9.0]]', '[]', 'people[0].route', 'one point'),
    'route into a wall': ('[8.0, 5.0]]', '[9.9, 5.0]]', 'routes.tour[1]', 'clear of hull'),
    'route of one point': (', [8.0, 5.0]]', ']', 'routes.tour', 'at least two'),
    'camera outside': (
        '[5.0, 5.0, 3.0]',
        '[-1.0, 5.0, 3.0]',
        'camera.position',
        'inside the outer',
    ),
    'camera among people': (
        '5.0, 5.0, 3.0',
        '5.0, 5.0, 1.6',
        'camera.position[2]',
        'above waiter',
    ),
    'lens that folds': (
        '{level: 1.0}',
        '{level: 1.0}\n  distortion: [-0.5, 0, 0, 0, 0]',
        'camera.distortion',
        'spreads rays',
    ),
    'disc off its plate': (
        '{height: 1.2}',
        '{front_x: 0.2}',
        'robot.marker.front_x',
        'on the plate',
    ),
    'key twice': ('  wheel_radius: 0.06', '  track: 0.3\n  track: 0.3', 'robot.track', 'once'),
}


@pytest.mark.parametrize('what', CASES)
def test_rules_refuse_naming_file_line_and_field(tmp_path: Path, what: str) -> None:
    """Each spoilt line is named by file and number, and the field in it by its path."""
    good, bad, field, words = CASES[what]
    assert GOOD.count(good) == 1
    text = GOOD.replace(good, bad)
    line = GOOD[: GOOD.index(good)].count('\n') + 1 + bad.count('\n')
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, text)
    error = caught.value
    assert error.field == field
    assert error.line == line
    assert str(error).startswith(f'{tmp_path / "cafe.yaml"}:{line}: {field}: got ')
    assert words in str(error)


TAGGED = GOOD.replace(
    'route: [[5.0, 1.0], [5.0, 9.0]]',
    'route: [[5.0, 1.0], [5.0, 9.0]], tag: {id: w1, position: [-0.25, 0.0, 1.0]}',
).replace(
    'robot:',
    'robot:\n  anchors:\n    - {id: R0, position: [0.2, 0.2, 1.0]}\n'
    '    - {id: R1, position: [-0.2, 0.2, 1.0]}\n    - {id: R2, position: [0.0, -0.2, 1.0]}',
)


def test_rules_accept_a_person_with_a_tag(tmp_path: Path) -> None:
    load_text(tmp_path, TAGGED)


@pytest.mark.parametrize(
    ('good', 'bad', 'field', 'words'),
    [
        ('id: w1', 'id: tag', 'people[0].tag.id', 'another name than tag_id'),
        ('id: w1', 'id: R1', 'people[0].tag.id', 'another name than robot.anchors[1].id'),
        ('id: R1', 'id: A0', 'robot.anchors[1].id', 'another name than anchors[0].id'),
        ('id: R1', 'id: R0', 'robot.anchors[1].id', 'another name than robot.anchors[0].id'),
        ('id: R1', "id: ''", 'robot.anchors[1].id', 'a word'),
        ('[0.0, -0.2, 1.0]', '[0.4, 0.2, 1.0]', 'robot.anchors', 'not in one line'),
        ('    - {id: R2, position: [0.0, -0.2, 1.0]}\n', '', 'robot.anchors', 'three anchors'),
        ('[-0.25, 0.0, 1.0]', '[-1.25, 0.0, 1.0]', 'people[0].tag.position', 'within 0.85 m'),
        ('[-0.25, 0.0, 1.0]', '[-0.25, 0.0, 1.9]', 'people[0].tag.position', '1.7 m over'),
        ('[-0.25, 0.0, 1.0]', '[-0.25, 0.0, .nan]', 'people[0].tag.position[2]', 'finite'),
    ],
)
def test_rules_refuse_tags_that_cannot_be(
    tmp_path: Path, good: str, bad: str, field: str, words: str
) -> None:
    assert TAGGED.count(good) == 1
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, TAGGED.replace(good, bad))
    assert caught.value.field == field
    assert words in str(caught.value)


SEVERAL = (
    GOOD
    + """\
robots:
  - {name: robot_1, start: [8.0, 6.0, 0.0]}
  - {name: robot_2, start: [8.0, 7.0, 0.0], colour: [30, 190, 60]}
  - {name: robot_3, start: [8.0, 5.0, 0.0], colour: [30, 90, 220], tag_id: T3}
"""
)


def test_rules_accept_several_robots(tmp_path: Path) -> None:
    load_text(tmp_path, SEVERAL)


@pytest.mark.parametrize(
    ('good', 'bad', 'field', 'words'),
    [
        ('name: robot_2', 'name: robot_1', 'robots[1].name', 'each name once'),
        ('name: robot_2', 'name: 2nd', 'robots[1].name', 'a letter first'),
        ('name: robot_2', 'name: a/b', 'robots[1].name', 'letters, digits'),
        ('[8.0, 7.0, 0.0]', '[8.0, 6.4, 0.0]', 'robots[1].start', '0.5 m from that of robot_1'),
        ('[8.0, 7.0, 0.0]', '[3.0, 3.0, 0.0]', 'robots[1].start', 'clear of table_1'),
        ('[8.0, 7.0, 0.0]', '[9.9, 7.0, 0.0]', 'robots[1].start', 'clear of hull'),
        ('[8.0, 7.0, 0.0]', '[12.0, 7.0, 0.0]', 'robots[1].start', 'inside the outer walls'),
        ('[8.0, 7.0, 0.0]', '[8.0, .nan, 0.0]', 'robots[1].start[1]', 'a finite number'),
        ('[30, 190, 60]', '[235, 60, 140]', 'robots[1].colour', 'from that of robot_1'),
        ('[30, 90, 220]', '[30, 190, 90]', 'robots[2].colour', 'from that of robot_2'),
        (', colour: [30, 190, 60]', '', 'robots[1].colour', 'from that of robot_1 (0 degrees'),
        ('[30, 190, 60]', '[130, 140, 130]', 'robots[1].colour', 'not a grey'),
        ('[30, 190, 60]', '[30, 300, 60]', 'robots[1].colour[1]', 'at most 255'),
        ('tag_id: T3', 'tag_id: robot_2', 'robots[2].tag_id', 'than robots[1].tag_id'),
        ('tag_id: T3', 'tag_id: A0', 'robots[2].tag_id', 'another name than anchors[0].id'),
        (
            'wheel_radius: 0.06',
            'anchors: [{id: R0, position: [0, 0, 1]}]',
            'robot.anchors',
            'none where there are several robots',
        ),
    ],
)
def test_rules_refuse_robots_that_cannot_be(
    tmp_path: Path, good: str, bad: str, field: str, words: str
) -> None:
    assert SEVERAL.count(good) == 1
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, SEVERAL.replace(good, bad))
    assert caught.value.field == field
    assert words in str(caught.value)


def test_rules_want_no_colours_of_robots_without_markers(tmp_path: Path) -> None:
    load_text(
        tmp_path, SEVERAL.replace('  marker: {height: 1.2}\n', '').replace('[30, 190, 60]', 'null')
    )


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('name: [', 'expected YAML'),
        ('- a\n- b\n', 'a mapping of fields'),
        ('walls: []\n', 'name: got .nothing.'),
        ('name: cafe\nstart: [1, 2, north]\n', r':2: start\[2\]: got .north.'),
    ],
)
def test_rules_refuse_a_file_that_is_no_scenario(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_text(tmp_path, text)


def test_rules_refuse_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'nowhere\.yaml.*a readable file'):
        load_scenario(tmp_path / 'nowhere.yaml')


def test_rules_refuse_a_marker_as_high_as_the_camera(tmp_path: Path) -> None:
    text = GOOD.replace('marker: {height: 1.2}', 'marker: {height: 3.0}')
    with pytest.raises(ConfigError, match=r"camera\.position\[2\].*above the robot's marker"):
        load_text(tmp_path, text)
