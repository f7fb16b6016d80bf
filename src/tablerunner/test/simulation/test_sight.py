"""Lines of sight between antennas at their heights."""

from __future__ import annotations

import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, Table, Wall
from tablerunner.simulation import PersonState
from tablerunner.simulation.sight import Sight, person_blocks

TAG = (0.0, 0.0, 1.1)
ANCHOR = (10.0, 0.0, 2.1)  # the sight climbs 0.1 m per metre


def wall_at(x: float, height: float) -> Sight:
    return Sight([Wall(points=((x, -1.0), (x, 1.0)), height=height).outline])


@pytest.mark.parametrize(
    ('x', 'height', 'blocks'),
    [
        (5.0, 2.6, True),
        (5.0, 1.61, True),
        (5.0, 1.59, False),
        (1.0, 1.21, True),
        (1.0, 1.19, False),
        (9.0, 1.99, False),
        (-1.0, 2.6, False),
        (11.0, 2.6, False),
    ],
)
def test_sight_over_a_wall_depends_on_its_height_and_place(
    x: float, height: float, blocks: bool
) -> None:
    """A wall at x metres blocks when it is higher than 1.1 m + 0.1 x."""
    assert wall_at(x, height).thing_blocks(TAG, ANCHOR) == blocks


def test_sight_beside_a_wall_is_free() -> None:
    sight = Sight([Wall(points=((5.0, 0.01), (5.0, 3.0))).outline])
    assert not sight.thing_blocks(TAG, ANCHOR)


def test_sight_over_a_table_is_free_and_through_a_column_is_not() -> None:
    """Tables are lower than the tag on the robot's head."""
    table = Table(name='t', x=5.0, y=0.0, stop=(0.0, 0.0, 0.0)).outline
    column = Box(name='c', x=5.0, y=0.0, length=0.4, width=0.4, height=2.6).outline
    assert not Sight([table]).thing_blocks(TAG, ANCHOR)
    assert Sight([table, column]).thing_blocks(TAG, ANCHOR)


def test_sight_to_an_anchor_on_the_wall_is_free() -> None:
    """What the anchor is screwed to does not hide it; what hides it from behind does."""
    on_wall = Sight([Wall(points=((10.0, -5.0), (10.0, 5.0))).outline])
    assert not on_wall.thing_blocks(TAG, ANCHOR)
    corner = Sight([Wall(points=((10.0, -5.0), (10.0, 0.0), (0.0, 0.0 + 1e-3))).outline])
    assert corner.thing_blocks((3.0, 2.0, 1.1), (10.0, -0.2, 2.1))


def test_sight_in_an_empty_room_is_free() -> None:
    assert not Sight([]).thing_blocks(TAG, ANCHOR)


@pytest.mark.parametrize(
    ('x', 'y', 'height', 'blocks'),
    [
        (5.0, 0.0, 1.7, True),
        (5.0, 0.24, 1.7, True),
        (5.0, 0.26, 1.7, False),
        (5.0, -0.24, 1.7, True),
        (8.0, 0.0, 1.7, False),  # the sight is 1.875 m high where it enters
        (6.3, 0.0, 1.7, False),  # 1.705 m
        (6.2, 0.0, 1.7, True),  # 1.695 m
        (0.2, 0.0, 1.7, True),  # the tag within the person's outline
        (-0.3, 0.0, 1.7, False),
        (10.3, 0.0, 3.0, False),
        (5.0, 0.0, 1.25, False),
    ],
)
def test_sight_past_a_person_depends_on_height_and_place(
    x: float, y: float, height: float, blocks: bool
) -> None:
    """A cylinder of 0.25 m radius blocks where the sight enters it below its top."""
    person = PersonState('p', Pose2(x, y), 0.0, 0.25)
    assert person_blocks(TAG, ANCHOR, [person], [height]) == blocks


def test_sight_straight_up_is_free_of_people() -> None:
    person = PersonState('p', Pose2(0.0, 0.0), 0.0, 0.25)
    assert not person_blocks(TAG, (0.0, 0.0, 2.1), [person], [1.7])
