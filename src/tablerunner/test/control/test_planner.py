from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from tablerunner.control import Disc, FloorMap, Planner, PlannerConfig, make_planner
from tablerunner.errors import ConfigError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments, polygon_edges, rectangle_corners
from tablerunner.scenario import Box, Scenario, Wall

RADIUS = 0.25
WALLS = polygon_edges(np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]]))
TABLE = rectangle_corners(4.0, 3.0, 0.4, 1.6, 1.0)
FLOOR = FloorMap.build(WALLS, (TABLE,), (Disc(6.5, 1.5, 0.4),))
PLANNER = Planner(FLOOR, RADIUS)
EMPTY = FloorMap.build(WALLS)
START, GOAL = Pose2(1.0, 3.0, 0.0), Pose2(7.0, 3.0, 0.0)


def clearance(points: np.ndarray) -> np.ndarray:
    """Return the true distance of points to walls, table and column."""
    segments = np.concatenate([WALLS, polygon_edges(TABLE)])
    column = np.hypot(points[:, 0] - 6.5, points[:, 1] - 1.5) - 0.4
    return np.minimum(distance_to_segments(points, segments).min(axis=1), column)


def test_floor_distances_are_those_of_the_geometry() -> None:
    """Outside of solids each cell holds the exact distance, inside zero."""
    centres = FLOOR.centres()
    inside = (np.abs(centres[:, 0]) < 8.0) & (FLOOR.distance.ravel() > 0.0)
    expected = clearance(centres[inside])
    assert np.allclose(FLOOR.distance.ravel()[inside], expected, atol=1e-9)
    assert FLOOR.distance[FLOOR.cell(4.0, 3.0)] == 0.0
    assert FLOOR.distance[FLOOR.cell(6.5, 1.5)] == 0.0


places = st.tuples(st.floats(0.4, 7.6), st.floats(0.4, 5.6))


@settings(max_examples=30, deadline=None)
@given(places, places)
def test_plan_between_free_places_keeps_its_clearance(
    start: tuple[float, float], goal: tuple[float, float]
) -> None:
    """Every point of a plan is as far from everything as promised, and it is no detour."""
    ends = np.array([start, goal])
    if clearance(ends).min() < RADIUS + 0.06 or FLOOR.distance_at(ends).min() < RADIUS + 0.06:
        return
    path = PLANNER.plan(Pose2(*start, 0.0), Pose2(*goal, 1.0))
    assert path.points[0] == pytest.approx(start)
    assert path.points[-1] == pytest.approx(goal)
    assert path.heading == 1.0
    points = path.resampled(0.02)
    ends_near = np.minimum(np.hypot(*(points - start).T), np.hypot(*(points - goal).T))
    config = PLANNER.config
    needed = np.where(ends_near <= config.end_radius, config.end_clearance, config.clearance)
    assert np.all(clearance(points) >= RADIUS + needed - 0.02)
    # The longest way round in this room, table and column included.
    assert path.length <= math.dist(start, goal) + 2.5


def test_plan_in_free_room_is_straight() -> None:
    path = PLANNER.plan(Pose2(1.0, 1.0, 0.0), Pose2(1.0, 5.0, 0.0), keep_heading=False)
    assert len(path.points) <= 3
    assert path.length == pytest.approx(4.0, rel=0.02)
    assert path.heading is None


@pytest.mark.parametrize(
    ('goal', 'words'),
    [
        (Pose2(12.0, 3.0, 0.0), 'outside the room'),
        (Pose2(4.0, 3.0, 0.0), 'inside an obstacle'),
        (Pose2(0.2, 3.0, 0.0), '0.20 m from an obstacle'),
        (Pose2(math.nan, 3.0, 0.0), 'not a finite'),
        (Pose2(1.0, 3.0, math.inf), 'not a finite'),
    ],
)
def test_plan_to_bad_goal_gives_the_reason(goal: Pose2, words: str) -> None:
    with pytest.raises(PlanningError, match=words):
        PLANNER.plan(Pose2(1.0, 1.0, 0.0), goal)


def test_plan_into_closed_room_says_that_no_way_leads_there() -> None:
    """A closed box in the room has floor that cannot be reached."""
    box = polygon_edges(np.array([[5.0, 3.5], [7.5, 3.5], [7.5, 5.5], [5.0, 5.5]]))
    planner = Planner(FloorMap.build(np.concatenate([WALLS, box])), RADIUS)
    with pytest.raises(PlanningError, match='no way leads'):
        planner.plan(Pose2(1.0, 1.0, 0.0), Pose2(6.2, 4.5, 0.0))


def test_plan_through_gap_depends_on_its_width() -> None:
    """A door as wide as the robot needs is taken, one a little narrower is not."""
    need = 2 * (RADIUS + PLANNER.config.clearance)
    for width, passes in ((need + 0.06, True), (need - 0.03, False)):
        parts = np.array(
            [
                [[4.0, 0.0], [4.0, 3.0 - width / 2]],
                [[4.0, 3.0 + width / 2], [4.0, 6.0]],
            ]
        )
        planner = Planner(FloorMap.build(np.concatenate([WALLS, parts])), RADIUS)
        if passes:
            assert planner.plan(Pose2(1.0, 3.0, 0.0), Pose2(7.0, 3.0, 0.0)).length < 6.2
        else:
            with pytest.raises(PlanningError, match='no way leads'):
                planner.plan(Pose2(1.0, 3.0, 0.0), Pose2(7.0, 3.0, 0.0))


def test_plan_around_blocked_place_keeps_away_from_it() -> None:
    blocked = Disc(2.0, 3.0, 0.4)
    start, goal = Pose2(2.0, 1.0, 0.0), Pose2(2.0, 5.0, 0.0)
    path = PLANNER.plan(start, goal, blocked=(blocked,))
    away = np.hypot(*(path.resampled(0.02) - [2.0, 3.0]).T)
    assert away.min() >= 0.4 + RADIUS + PLANNER.config.clearance - 0.02
    assert PLANNER.plan(start, goal).length < path.length


def test_plan_to_blocked_goal_says_so() -> None:
    with pytest.raises(PlanningError, match='something stands at the goal'):
        PLANNER.plan(Pose2(1.0, 1.0, 0.0), Pose2(2.0, 4.0, 0.0), blocked=(Disc(2.0, 4.0, 0.3),))


def test_plan_from_too_near_a_wall_leaves_it() -> None:
    """Localisation may believe the robot in the wall; it is driven out, not given up."""
    path = PLANNER.plan(Pose2(0.1, 1.0, 0.0), Pose2(2.0, 1.0, 0.0))
    assert path.length == pytest.approx(1.9, abs=0.1)


def test_plan_from_inside_a_table_is_refused() -> None:
    with pytest.raises(PlanningError, match='no floor to drive on'):
        PLANNER.plan(Pose2(30.0, 3.0, 0.0), Pose2(2.0, 1.0, 0.0))


def test_floor_without_walls_is_refused() -> None:
    with pytest.raises(PlanningError, match='no walls'):
        FloorMap.build(np.empty((0, 2, 2)))


def test_floor_of_a_whole_town_is_refused() -> None:
    with pytest.raises(PlanningError, match='larger cells'):
        FloorMap.build(WALLS * 1000.0)


def test_planner_config_with_swapped_clearances_is_refused() -> None:
    with pytest.raises(ConfigError, match='end_clearance'):
        PlannerConfig(clearance=0.1, end_clearance=0.2)


def test_plan_that_cares_for_length_only_still_keeps_its_clearance() -> None:
    """Nothing but the check of the straight line itself keeps corners from being cut here."""
    thin = np.array([[[4.0, 0.0], [4.0, 4.0]]])
    floor = FloorMap.build(np.concatenate([WALLS, thin]))
    planner = Planner(floor, RADIUS, PlannerConfig(comfort_weight=0.0))
    path = planner.plan(Pose2(2.5, 1.0, 0.0), Pose2(5.5, 1.0, 0.0))
    points = path.resampled(0.02)
    gap = distance_to_segments(points, np.concatenate([WALLS, thin])).min()
    assert gap >= RADIUS + planner.config.clearance - 0.02
    # Up, over the end of the wall, and down.
    assert path.length < 2 * math.hypot(1.5 - 0.37, 3.37) + 1.5


def test_plan_leads_through_what_the_map_does_not_know() -> None:
    """A box that is not on the map is there for the sensors to find."""
    wall = Wall(((0.0, 0.0), (6.0, 0.0), (6.0, 3.0), (0.0, 3.0)), 'hull', True)
    box = Box('crate', 3.0, 1.5, 0.5, 0.5)
    lengths = []
    for unmapped in (False, True):
        room = Scenario(name='room', walls=(wall,), boxes=(box.replace(unmapped=unmapped),))
        path = make_planner(room).plan(Pose2(1.0, 1.5), Pose2(5.0, 1.5))
        lengths.append(path.length)
    assert lengths[0] > 4.2
    assert lengths[1] == pytest.approx(4.0)


def test_plan_keeps_off_where_something_may_be_unless_it_costs_too_much() -> None:
    """Dear, but not forbidden: with discs beside it too."""
    rows, columns = EMPTY.shape
    xs, ys = EMPTY.centres().reshape(rows, columns, 2).transpose(2, 0, 1)

    def plan(low: float, high: float, blocked: tuple[Disc, ...] = ()) -> np.ndarray:
        there = (np.abs(xs - 4.0) <= 0.3) & (ys >= low) & (ys <= high)
        away = ndimage.distance_transform_edt(~there, sampling=EMPTY.resolution)
        floor = replace(EMPTY, unseen=away)
        path = Planner(floor, RADIUS).plan(START, GOAL, blocked=blocked)
        return path.resampled(0.02)

    beside = plan(2.8, 3.2)
    near = np.abs(beside[:, 0] - 4.0) < 0.3
    assert np.abs(beside[near, 1] - 3.0).min() > 0.3
    far = Disc(4.0, 5.2, 0.2)
    assert np.abs(plan(2.8, 3.2, (far,))[:, 1] - 3.0).max() > 0.3
    through = plan(0.0, 6.0)  # all across the room
    assert np.abs(through[:, 1] - 3.0).max() < 0.1
