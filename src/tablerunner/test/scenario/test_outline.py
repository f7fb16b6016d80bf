"""Footprints of walls, tables and boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.scenario import Box, Table, Wall


def test_wall_outline_open_has_one_edge_less_than_points() -> None:
    wall = Wall(points=((0.0, 0.0), (1.0, 0.0), (1.0, 2.0)))
    assert wall.outline.segments.tolist() == [[[0, 0], [1, 0]], [[1, 0], [1, 2]]]


def test_wall_outline_closed_comes_back_and_has_no_inside() -> None:
    """A closed wall is the room's hull: what stands inside it does not stand in it."""
    wall = Wall(points=((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)), closed=True)
    assert wall.outline.segments.shape == (4, 2, 2)
    assert not wall.outline.contains(np.array([[2.0, 2.0]])).any()


def test_table_outline_rectangle_lies_along_its_heading() -> None:
    """Length along the heading, width across it."""
    table = Table(
        name='t', x=2.0, y=3.0, stop=(0.0, 0.0, 0.0), heading=math.pi / 2, length=2.0, width=1.0
    )
    corners = table.outline.corners
    assert corners.min(axis=0) == pytest.approx([1.5, 2.0])
    assert corners.max(axis=0) == pytest.approx([2.5, 4.0])


def test_table_outline_round_holds_the_circle() -> None:
    """The polygon touches the circle from outside: a path that clears it clears the table."""
    table = Table(name='t', x=1.0, y=1.0, stop=(0.0, 0.0, 0.0), shape='round', length=1.0)
    angles = np.linspace(0.0, 2 * math.pi, 100)
    circle = 1.0 + 0.4999 * np.column_stack([np.cos(angles), np.sin(angles)])
    assert table.outline.contains(circle).all()
    radii = np.linalg.norm(table.outline.corners - 1.0, axis=1)
    assert radii.max() < 0.5 * 1.03


@pytest.mark.parametrize(
    ('point', 'inside'), [((1.0, 1.0), True), ((1.0, 1.6), False), ((2.1, 1.0), False)]
)
def test_box_outline_contains_only_what_is_inside(
    point: tuple[float, float], inside: bool
) -> None:
    box = Box(name='b', x=1.0, y=1.0, length=2.0, width=1.0)
    assert box.outline.contains(np.array([point]))[0] == inside
