"""When a place counts as blocked for good."""

from __future__ import annotations

from tablerunner.control import Disc
from tablerunner.control.blockades import BlockadeConfig, Blockades
from tablerunner.types import NANOSECONDS, nanoseconds

CONFIG = BlockadeConfig(times=3, span=40.0, stood=15.0, near=0.6, memory=100.0)
LONG_S = 16.0
NOW = 10 * NANOSECONDS


def after(seconds_: float) -> int:
    return NOW + nanoseconds(seconds_)


def test_a_place_stands_when_met_often_and_over_a_long_time() -> None:
    blockades = Blockades(CONFIG)
    for at in (0.0, 20.0):
        blockades.add(Disc(1.0 + at / 100.0, 2.0, 0.3), after(at), LONG_S)
        assert blockades.standing(after(at)) == ()
    last = Disc(1.1, 2.1, 0.3)
    blockades.add(last, after(40.0), LONG_S)
    assert blockades.standing(after(40.0)) == (last,)
    assert blockades.times(Disc(1.0, 2.0, 0.3), after(40.0)) == 3


def test_often_within_a_short_time_is_somebody_who_waits() -> None:
    blockades = Blockades(CONFIG)
    for at in range(10):
        blockades.add(Disc(1.0, 2.0, 0.3), after(float(at)), LONG_S)
    assert blockades.standing(after(10.0)) == ()


def test_who_never_stands_there_for_long_is_not_one_who_stays() -> None:
    """A door through which people keep coming holds the robot up as often as a trolley in it."""
    door = Disc(1.0, 2.0, 0.3)
    blockades = Blockades(CONFIG)
    for at in (0.0, 20.0, 40.0):
        blockades.add(door, after(at), 9.0)
    assert blockades.standing(after(40.0)) == ()
    blockades.add(door, after(41.0), LONG_S)  # the same time still, and he stands
    assert blockades.times(door, after(41.0)) == 3
    assert blockades.standing(after(41.0)) == (door,)


def test_places_apart_are_not_the_same() -> None:
    blockades = Blockades(CONFIG)
    for at in range(5):
        blockades.add(Disc(1.0 + 0.7 * at, 2.0, 0.3), after(20.0 * at), LONG_S)
    assert blockades.standing(after(80.0)) == ()


def test_what_was_long_ago_is_tried_again() -> None:
    blockades = Blockades(CONFIG)
    for at in (0.0, 20.0, 40.0):
        blockades.add(Disc(1.0, 2.0, 0.3), after(at), LONG_S)
    assert blockades.standing(after(99.0))
    assert blockades.standing(after(101.0)) == ()
    blockades.clear()
    assert blockades.times(Disc(1.0, 2.0, 0.3), after(41.0)) == 0
