"""Where the robot makes way."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.control import Disc, Planner, floor_map
from tablerunner.control.path import Path
from tablerunner.control.refuge import way_to_refuge
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, Wall

OUTER = Wall(((0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)), 'outer', closed=True)
AISLE = (Wall(((3.0, 2.0), (8.0, 2.0)), 'left'), Wall(((3.0, 0.9), (8.0, 0.9)), 'right'))
PATH = Path(np.array([[1.0, 1.45], [7.5, 1.45]]))
OTHER = Disc(4.6, 1.45, 0.3)


def planner(*walls: Wall) -> Planner:
    return Planner(floor_map(Scenario('room', walls=(OUTER, *walls))), 0.25)


def test_out_of_an_aisle_and_aside() -> None:
    where = planner(*AISLE)
    way = way_to_refuge(where, Pose2(4.0, 1.45, 0.0), OTHER, PATH, 3.5)
    assert way is not None
    end_x, end_y = way.end
    assert end_x < 3.1  # behind it is the only way out
    assert math.hypot(end_x - OTHER.x, end_y - OTHER.y) >= 1.6
    assert float(where.floor.distance_at(np.array([end_x, end_y]))) >= 0.54  # 0.25 + 0.3, a cell
    assert way.length <= 6.0


def test_does_not_wait_in_its_own_path_where_there_is_room_beside() -> None:
    way = way_to_refuge(planner(), Pose2(4.0, 1.45, 0.0), OTHER, PATH, 3.5)
    assert way is not None
    assert abs(way.end[1] - 1.45) >= 0.5 or way.end[0] < 3.3


def test_no_way_out_is_told() -> None:
    closed = (*AISLE, Wall(((3.0, 0.9), (3.0, 2.0)), 'end'))
    assert way_to_refuge(planner(*closed), Pose2(4.0, 1.45, 0.0), OTHER, PATH, 3.5) is None
