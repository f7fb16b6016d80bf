"""Random rooms are what they say they are, held against the planner, which had no part in it."""

from __future__ import annotations

import math
from collections import Counter
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.config.build import to_mapping
from tablerunner.control import Disc, Planner, PlannerConfig, floor_map
from tablerunner.errors import PlanningError
from tablerunner.experiments.random_room import KINDS, UNKNOWN_SPACE_M, DriveRoom, make_drive_room
from tablerunner.geometry.segments import distance_to_segments

made = lru_cache(maxsize=None)(make_drive_room)
SEEDS = st.integers(0, 11)


def planner_of(room: DriveRoom, clearance: float) -> Planner:
    """Return a planner that knows everything that stands in the room."""
    standing = tuple(
        Disc(*person.route[0], person.radius)
        for person in room.scenario.people
        if len(person.route) == 1
    )
    config = PlannerConfig(
        clearance=clearance, end_clearance=min(clearance, 0.05), comfort_weight=0.0
    )
    floor = floor_map(room.scenario).with_discs(standing)
    return Planner(floor, room.scenario.robot.footprint_radius, config)


def ways(room: DriveRoom, clearance: float) -> dict[str, bool]:
    """Return to which stops of the tour the planner finds a way."""
    planner, found = planner_of(room, clearance), {}
    for name in room.tour:
        try:
            planner.plan(room.scenario.start_pose, room.scenario.stop_pose(name))
            found[name] = True
        except PlanningError:
            found[name] = False
    return found


def test_same_seed_same_room() -> None:
    first, again, other = make_drive_room(3), make_drive_room(3), make_drive_room(4)
    assert to_mapping(first.scenario) == to_mapping(again.scenario)
    assert (first.tour, first.closed, first.unknown) == (again.tour, again.closed, again.unknown)
    assert to_mapping(first.scenario) != to_mapping(other.scenario)


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_planner_agrees_on_what_can_be_reached(seed: int) -> None:
    """Its own clearance, 0.12 m, lies between those that the generator asks for."""
    room = made(seed)
    assert ways(room, 0.12) == {name: name not in room.closed for name in room.tour}
    assert not any(ways(room, 0.0)[name] for name in room.closed)


@pytest.mark.parametrize('seed', [*range(12), 16127])
def test_home_is_free(seed: int) -> None:
    """Also where nothing else of the tour is: in 16127 somebody stood in it once."""
    room = made(seed)
    needed = room.scenario.robot.footprint_radius + 0.12
    home = room.scenario.start_pose
    assert planner_of(room, 0.12).floor.distance_at(np.array([home.x, home.y])) >= needed


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_map_lacks_what_is_unknown_and_nothing_else(seed: int) -> None:
    room = made(seed)
    names = [box.name for box in room.scenario.boxes]
    assert set(room.unknown) <= set(names)
    assert [box.name for box in room.known.boxes] == [n for n in names if n not in room.unknown]
    assert room.known.people == ()
    assert (room.known.walls, room.known.tables) == (room.scenario.walls, room.scenario.tables)


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_tour_people_and_start_are_sound(seed: int) -> None:
    room = made(seed)
    scenario = room.scenario
    assert 1 <= len(room.tour) <= 3
    assert len(set(room.tour)) == len(room.tour)
    assert set(room.closed) <= set(room.tour)
    assert bool(room.closed) == (room.kind != 'open')
    assert len(scenario.anchors) == 4
    walking = [person for person in scenario.people if len(person.route) > 1]
    assert len(walking) <= 10
    home = scenario.start_pose
    assert all(math.dist(person.route[0], (home.x, home.y)) >= 1.0 for person in scenario.people)
    start = np.array([[home.x, home.y]])
    segments = [box.outline.segments for box in scenario.boxes if box.name in room.unknown]
    if segments:
        away = float(np.min(distance_to_segments(start, np.concatenate(segments))))
        assert away > scenario.robot.footprint_radius + UNKNOWN_SPACE_M


def test_every_kind_of_room_comes() -> None:
    """Over 200 seeds of the first draw alone: chance of a kind to be missing is below 1e-5."""
    kinds = Counter(
        str(np.random.default_rng((seed, 0x5EED)).choice(list(KINDS), p=list(KINDS.values())))
        for seed in range(200)
    )
    assert set(kinds) == set(KINDS)
    assert made(10).kind in KINDS
    assert sum(KINDS.values()) == pytest.approx(1.0)
