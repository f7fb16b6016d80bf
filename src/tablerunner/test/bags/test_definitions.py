"""Message definitions: one truth, wherever they are taken from."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.definitions import (
    known_types,
    own_definitions,
    parse_definition,
    types_for,
)
from tablerunner.errors import BagError

INTERFACES = Path(__file__).parents[4] / 'src' / 'tablerunner_interfaces' / 'msg'


def test_own_definitions_equal_those_of_the_interfaces_package() -> None:
    """The data files of this package are those that ROS builds, byte for byte."""
    if not INTERFACES.is_dir():
        pytest.skip('the package tablerunner_interfaces is not beside this one')
    theirs = {
        f'tablerunner_interfaces/msg/{file.stem}': file.read_text(encoding='utf-8')
        for file in INTERFACES.glob('*.msg')
    }
    assert own_definitions() == theirs


def test_known_types_hold_every_contract_type() -> None:
    for topic, contract in CONTRACT.items():
        assert contract.msgtype in known_types().fielddefs, topic


def test_types_for_installed_definition_goes_before_the_built_in(tmp_path: Path) -> None:
    """What the sourced workspace says of a type is what runs; nested types are found too."""
    folder = tmp_path / 'share' / 'other_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Inner.msg').write_text('float64 value\n')
    (folder / 'Outer.msg').write_text('std_msgs/Header header\nInner[] inner\nInner[3] three\n')
    store = types_for(['other_msgs/msg/Outer', 'nav_msgs/msg/Path'], [tmp_path])
    assert {'other_msgs/msg/Inner', 'builtin_interfaces/msg/Time'} <= set(store.fielddefs)
    text, _ = store.generate_msgdef('other_msgs/msg/Outer', ros_version=2)
    assert 'MSG: other_msgs/Inner' in text
    assert store.hash_rihs01('nav_msgs/msg/Path') == known_types().hash_rihs01('nav_msgs/msg/Path')


def test_types_for_unknown_type_names_it(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r'no definition of a_msgs/msg/B, c/msg/D'):
        types_for(['c/msg/D', 'a_msgs/msg/B'], [tmp_path])


def test_types_for_malformed_definition_names_it(tmp_path: Path) -> None:
    folder = tmp_path / 'share' / 'bad_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Bad.msg').write_text('float64 [ value\n')
    with pytest.raises(BagError, match='bad_msgs/msg/Bad cannot be read'):
        types_for(['bad_msgs/msg/Bad'], [tmp_path])


def test_parse_definition_of_another_type_raises() -> None:
    idl = 'module a_msgs { module msg { struct B { double x; }; }; };'
    assert 'a_msgs/msg/B' in parse_definition('a_msgs/msg/B', 'ros2idl', idl)
    with pytest.raises(BagError, match='of another type'):
        parse_definition('a_msgs/msg/C', 'ros2idl', idl)
    with pytest.raises(BagError, match='cannot be read'):
        parse_definition('a_msgs/msg/B', 'ros2msg', 'float64 [ x')
