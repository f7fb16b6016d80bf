"""What the drive test says of tours; a few of them for real, the rest made up."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tablerunner.config.build import to_mapping
from tablerunner.errors import ConfigError
from tablerunner.experiments.drive_record import load_room, save_room
from tablerunner.experiments.drive_room import THERE_M, Leg, RoomDrive, drive_room
from tablerunner.experiments.drive_test import DriveTest, run_drive_test
from tablerunner.experiments.random_room import make_drive_room
from tablerunner.geometry.pose import Pose2
from tablerunner.simulation import Contact

QUICK = {10: 'door closed', 1002: 'walled in', 1006: 'open'}
"""Seeds of short tours and their kinds."""


@cache
def tour(seed: int, controller: str = 'fuzzy') -> RoomDrive:
    return drive_room(make_drive_room(seed), controller)


def leg(**changes: object) -> Leg:
    return replace(Leg('table_1', True, True, 0.1, '', 20.0, 5.5, 5.0), **changes)


def made_up(*legs: Leg, home: Leg | None = None, **changes: object) -> RoomDrive:
    ways = (*(legs or (leg(),)), home or leg(stop='kitchen', shortest_m=math.nan))
    drive = RoomDrive(
        3, 'fuzzy', 'open', ways, (), True, 50.0, 11.0, 0.05, 0.1, 0.02, (),
        np.zeros((2, 6)), np.zeros((2, 0, 2)),
    )  # fmt: skip
    return replace(drive, **changes)


def contact(at_fault: bool) -> Contact:
    return Contact(13_000_000_000, 'person', 'guest', at_fault, 0.21, Pose2())


@pytest.mark.parametrize('seed', QUICK)
def test_tour_is_driven_and_what_cannot_be_reached_is_told(seed: int) -> None:
    drive, room = tour(seed), make_drive_room(seed)
    assert room.kind == QUICK[seed]
    assert not drive.faults
    assert [item.stop for item in drive.legs] == [*room.tour, 'kitchen']
    for item in drive.legs:
        assert item.reached is (item.stop not in room.closed)
        if item.reached and math.isfinite(item.shortest_m):
            # 0.12 m may be missing at both ends; nobody is faster than straight.
            assert item.way_m > item.shortest_m - 0.3
    assert sum(item.way_m for item in drive.legs) == pytest.approx(drive.way_m, abs=0.2)
    assert sum(item.time_s for item in drive.legs) == pytest.approx(drive.time_s, abs=0.1)
    assert drive.rmse_m < 0.3
    steps = np.hypot(*np.diff(drive.track[:, 1:3], axis=0).T)
    assert float(steps.sum()) == pytest.approx(drive.way_m, rel=0.02)


def test_same_room_same_tour_whoever_makes_it() -> None:
    again = run_drive_test([10], ['fuzzy'], workers=1).drives[0]
    assert again.as_json() == tour(10).as_json()
    assert np.array_equal(again.track, tour(10).track, equal_nan=True)


@pytest.mark.parametrize(
    ('drive', 'fault'),
    [
        (made_up(contacts=(contact(True),)), 'hit guest at 0.21 m/s after 12.0 s'),
        (made_up(ended=False), 'still driving after 50 s'),
        (made_up(leg(reached=False, reason='blocked')), 'table_1 missed: blocked'),
        (made_up(leg(reached=False, reason='')), 'table_1 missed: not tried'),
        (made_up(leg(off_m=THERE_M + 0.1)), 'table_1: said to have arrived 0.50 m away'),
        (
            made_up(leg(is_open=False, reached=False, reason='')),
            'table_1 cannot be reached, and no reason was given',
        ),
        (made_up(leg(is_open=False)), 'table_1 cannot be reached, and no reason was given'),
    ],
)
def test_what_goes_wrong_is_said_and_breaks_a_bound(drive: RoomDrive, fault: str) -> None:
    assert drive.faults == (fault,)
    assert not DriveTest((drive,)).holds


def test_what_goes_right_keeps_all_bounds() -> None:
    closed = leg(stop='table_2', is_open=False, reached=False, reason='no way leads there')
    drive = made_up(leg(), closed, contacts=(contact(False),))
    assert drive.faults == ()
    test = DriveTest((drive,))
    assert test.holds
    rows = {row.name: row.measured.mean for row in test.rows()}
    assert rows['fuzzy, touches by people'] == 1.0
    assert rows['fuzzy, way over the shortest'] == pytest.approx(1.1)
    assert rows['fuzzy, stops reported that cannot be'] == 100.0


def test_one_missed_stop_in_a_hundred_is_allowed() -> None:
    missed = leg(reached=False, reason='blocked')
    good = made_up(*(leg() for _ in range(99)))
    assert DriveTest((good, made_up(missed))).holds
    assert not DriveTest((good, made_up(missed, missed))).holds


def test_way_home_is_a_stop_and_no_delivery() -> None:
    home = leg(stop='kitchen', reached=False, reason='blocked')
    drive = made_up(leg(), home=home)
    test = DriveTest((drive,))
    rows = {row.name: row.measured.mean for row in test.rows()}
    assert rows['fuzzy, deliveries that arrive where they can'] == 100.0
    assert rows['fuzzy, stops reached that can be'] == 50.0
    assert drive.faults == ('kitchen missed: blocked',)  # told, saved, but not what is judged
    assert test.holds


def test_controllers_are_compared_on_the_same_whole_legs() -> None:
    other = leg(stop='table_2')
    ours = made_up(leg(time_s=30.0, way_m=6.0), other)
    theirs = made_up(leg(), replace(other, reached=False, reason='x'), controller='pure_pursuit')
    rows = {row.name: row.measured for row in DriveTest((ours, theirs)).rows()}
    assert rows['fuzzy, time over pure_pursuit'].count == 1
    assert rows['fuzzy, time over pure_pursuit'].mean == pytest.approx(1.5)
    assert rows['fuzzy, way over pure_pursuit'].mean == pytest.approx(6.0 / 5.5)


def test_unknown_controller_is_refused() -> None:
    with pytest.raises(ConfigError, match='fuzzy, pure_pursuit, all'):
        run_drive_test([1], ['clever'])


def test_saved_room_is_the_same_room(tmp_path: Path) -> None:
    room = make_drive_room(10)
    file = save_room(tmp_path, room, [made_up(ended=False, rmse_m=math.nan)])
    again = load_room(file)
    assert to_mapping(again.scenario) == to_mapping(room.scenario)
    for name in ('seed', 'kind', 'unknown', 'tour', 'closed', 'unknown_start'):
        assert getattr(again, name) == getattr(room, name)
    assert drive_room(again, 'fuzzy').as_json() == tour(10).as_json()
    content = json.loads(file.with_suffix('.json').read_text())
    assert content['drives'][0]['faults'] == ['still driving after 50 s']
    assert content['drives'][0]['rmse_m'] is None


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'seed': 'x'}, "seed: got 'x', expected a number"),
        ({'tour': ['table_99']}, 'expected tables of the scenario'),
        ({'unknown': ['ghost']}, 'expected boxes of the scenario'),
        (None, 'JSON file of a saved room'),
    ],
)
def test_damaged_record_is_refused(
    tmp_path: Path, change: dict[str, object] | None, words: str
) -> None:
    file = save_room(tmp_path, make_drive_room(10))
    beside = file.with_suffix('.json')
    text = 'nonsense'
    if change is not None:
        text = json.dumps({**json.loads(beside.read_text()), **change})
    beside.write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_room(file)
