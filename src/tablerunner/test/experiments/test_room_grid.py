"""The flood fill against geometry that can be done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.experiments.room_grid import CELL_M, RoomGrid
from tablerunner.scenario import Box, Table, Wall

SIZE = (6.0, 4.0)
OUTER = Wall(((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)), 'outer', closed=True)
GOOD_M = 1.5 * CELL_M  # half a diagonal of a cell at both ends


def door(width: float) -> tuple[Wall, Wall]:
    """Return a partition at x = 3 with a door in its middle."""
    low, high = 2.0 - width / 2.0, 2.0 + width / 2.0
    return Wall(((3.0, 0.0), (3.0, low)), 'a'), Wall(((3.0, high), (3.0, 4.0)), 'b')


def test_distances_are_those_to_walls_solids_and_circles() -> None:
    box = Box('box', 2.0, 2.0, 1.0, 0.6, math.pi / 2)
    grid = RoomGrid(SIZE, (OUTER.outline,), (box.outline,), ((5.0, 1.0, 0.3),))
    rng = np.random.default_rng(1)
    for x, y in rng.uniform((0.0, 0.0), SIZE, (200, 2)):
        cell = grid.cell((x, y))
        wall = min(x, y, 6.0 - x, 4.0 - y)
        assert grid.known[cell] == pytest.approx(wall, abs=GOOD_M)
        to_box = math.hypot(max(abs(x - 2.0) - 0.3, 0.0), max(abs(y - 2.0) - 0.5, 0.0))
        to_circle = max(math.hypot(x - 5.0, y - 1.0) - 0.3, 0.0)
        assert grid.unknown[cell] == pytest.approx(min(to_box, to_circle), abs=GOOD_M)


@pytest.mark.parametrize(('width', 'passes'), [(0.9, True), (0.85, True), (0.75, False)])
def test_door_joins_two_rooms_when_it_is_wide_enough(width: float, passes: bool) -> None:
    walls = (OUTER, *door(width))
    grid = RoomGrid(SIZE, tuple(wall.outline for wall in walls))
    free = grid.free(0.4, 0.4)  # needs a passage of 0.8 m
    assert grid.joined((1.0, 2.0), ((5.0, 2.0), (1.0, 3.0)), free) == (passes, True)


def test_more_space_is_asked_beside_what_is_not_on_the_map() -> None:
    posts = tuple(Box(f'post {y}', 3.0, y, 0.1, 3.2).outline for y in (0.0, 4.0))
    known = RoomGrid(SIZE, (OUTER.outline, *posts))
    unknown = RoomGrid(SIZE, (OUTER.outline,), posts)
    ends = ((1.0, 2.0), ((5.0, 2.0),))
    assert known.joined(*ends, known.free(0.37, 0.47)) == (True,)  # 0.8 m between the posts
    assert unknown.joined(*ends, unknown.free(0.37, 0.47)) == (False,)


def test_place_in_a_table_is_joined_with_nothing() -> None:
    table = Table('t', 3.0, 2.0, (1.0, 1.0, 0.0), 'round', length=1.0)
    grid = RoomGrid(SIZE, (OUTER.outline, table.outline))
    assert grid.joined((1.0, 2.0), ((3.0, 2.0),), grid.free(0.1, 0.1)) == (False,)
    assert grid.joined((3.0, 2.0), ((3.0, 2.0),), grid.free(0.1, 0.1)) == (False,)


def test_line_is_free_up_to_its_space() -> None:
    grid = RoomGrid(SIZE, (OUTER.outline,), (Box('box', 3.0, 2.0, 1.0, 1.0).outline,))
    assert grid.line_is_free((1.0, 1.0), (5.0, 1.0), 0.45)
    assert not grid.line_is_free((1.0, 1.0), (5.0, 1.0), 0.55)
    assert not grid.line_is_free((1.0, 2.0), (5.0, 2.0), 0.1)


def test_drawn_places_are_free() -> None:
    grid = RoomGrid(SIZE, (OUTER.outline,))
    rng = np.random.default_rng(2)
    free = grid.free(1.5, 0.0)
    places = [grid.draw(rng, free) for _ in range(100)]
    assert all(grid.space_at(place) >= 1.5 for place in places if place is not None)
    assert len(set(places)) > 50
    assert grid.draw(rng, grid.free(9.0, 0.0)) is None
