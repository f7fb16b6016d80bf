"""Random rooms to drive in: walls, tables, things that are not on the map, people, a tour.

The same seed gives the same room. What kind of room it is, how many people walk in it and how
many tables are served is drawn first, so that a layout that is thrown away changes none of it.
docs/drive_test.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tablerunner.errors import ConfigError
from tablerunner.experiments.room_grid import Mask, Point, RoomGrid
from tablerunner.experiments.room_layout import (
    Layout,
    add_box,
    add_partition,
    add_table,
    outer_wall,
)
from tablerunner.scenario import AnchorPlace, Box, Kitchen, Person, Scenario, Wall

KINDS = {
    'open': 0.72,
    'walled in': 0.07,
    'door closed': 0.07,
    'door blocked': 0.07,
    'stop taken': 0.07,
}
"""Kinds of rooms and how likely they are. All but the first hold a table that cannot be reached:
walls all round it; a thing on the map in the only door; one that is not on the map; somebody who
stands where the robot is to stand."""

KNOWN_SPACE_M = 0.15
UNKNOWN_SPACE_M = 0.25
"""A place can be reached where a way leads that keeps these spaces between the hull and things
that the map shows, or does not show: passages are 0.8 m wide, and 1.0 m beside a chair."""

CLOSED_SPACE_M = 0.02
"""It cannot be reached where not even a way with this space leads there. Rooms with a stop that is
neither the one nor the other are left out."""

UNKNOWN_START = 0.3
"""Share of the rooms in which the robot is not told where it starts."""

_TRIES = 400
_NEVER_YIELDS = 0.15
_STANDS = 0.25
_WALKER_SPACE_M = 0.07


@dataclass(frozen=True, eq=False)
class DriveRoom:
    """A room, what the robot's map of it shows, and where to deliver.

    Attributes
    ----------
    seed : int
    kind : str
        One of `KINDS`.
    scenario : Scenario
        The room as it is.
    unknown : tuple of str
        Names of the boxes that the robot's map does not show.
    tour : tuple of str
        Tables to serve; then home.
    closed : tuple of str
        Those of them that cannot be reached.
    unknown_start : bool
        Whether the robot has to find out where it starts.
    """

    seed: int
    kind: str
    scenario: Scenario
    unknown: tuple[str, ...]
    tour: tuple[str, ...]
    closed: tuple[str, ...]
    unknown_start: bool

    @property
    def known(self) -> Scenario:
        """The room as the robot's map shows it."""
        boxes = tuple(box for box in self.scenario.boxes if box.name not in self.unknown)
        return replace(self.scenario, boxes=boxes, people=())

    @property
    def is_open(self) -> bool:
        """Whether all of the tour can be reached."""
        return not self.closed


@dataclass(frozen=True)
class _Plan:
    """What is drawn before the layout."""

    kind: str
    walkers: int
    tables: int
    unknown: int
    unknown_start: bool


def make_drive_room(seed: int) -> DriveRoom:
    """Return the room of a seed.

    Raises
    ------
    RuntimeError
        None was found in many tries.
    """
    rng = np.random.default_rng((seed, 0x5EED))
    plan = _Plan(
        kind=str(rng.choice(list(KINDS), p=list(KINDS.values()))),
        walkers=int(rng.integers(0, 11)),
        tables=int(rng.integers(1, 4)),
        unknown=int(rng.integers(0, 4)),
        unknown_start=bool(rng.random() < UNKNOWN_START),
    )
    for _ in range(_TRIES):
        try:
            room = _draw(rng, seed, plan)
        except ConfigError:  # something stands in something else: `tablerunner.scenario.rules`
            continue
        if room is not None:
            return room
    raise RuntimeError(f'no room found for seed {seed}')


def _draw(rng: np.random.Generator, seed: int, plan: _Plan) -> DriveRoom | None:
    size = (round(float(rng.uniform(8.0, 16.0)), 2), round(float(rng.uniform(7.0, 14.0)), 2))
    blank = Scenario('blank')
    layout = Layout(size, blank.robot.footprint_radius, [outer_wall(size)])
    closed_table = _build(layout, rng, plan)
    if closed_table == '' or len(layout.tables) < plan.tables:
        return None
    grid = RoomGrid(size, layout.outlines)
    kitchen = _kitchen(layout, rng, grid)
    if kitchen is None:
        return None
    others = [table.name for table in layout.tables if table.name != closed_table]
    needed = plan.tables - (closed_table is not None)
    if len(others) < needed:
        return None
    tour = [str(name) for name in rng.permutation(others)[:needed]]
    closed = []
    if closed_table is not None:
        tour.insert(int(rng.integers(len(tour) + 1)), closed_table)
        closed.append(closed_table)
    places = {table.name: (table.stop[0], table.stop[1]) for table in layout.tables}
    stops = tuple(places[name] for name in tour)
    unknown = _unknown(layout, rng, plan, grid, kitchen[:2], stops)
    standing = _standing(rng, grid, (kitchen[:2], *stops))
    if plan.kind == 'stop taken':
        closed.append(tour[int(rng.integers(len(tour)))])
        standing = (*standing, Person('standing in the way', (places[closed[0]],)))
    grid = RoomGrid(
        size,
        layout.outlines,
        tuple(box.outline for box in unknown),
        tuple((*person.route[0], person.radius) for person in standing),
    )
    open_stops = [places[name] for name in tour if name not in closed]
    shut_stops = [places[name] for name in closed]
    if not _as_meant(grid, layout.radius, kitchen[:2], open_stops, shut_stops):
        return None
    height = round(float(rng.uniform(2.0, 2.5)), 2)
    corners = (
        (0.2, 0.2),
        (size[0] - 0.2, 0.2),
        (size[0] - 0.2, size[1] - 0.2),
        (0.2, size[1] - 0.2),
    )
    scenario = Scenario(
        name=f'room {seed}',
        walls=tuple(layout.walls),
        tables=tuple(layout.tables),
        boxes=(*layout.boxes, *unknown),
        kitchen=Kitchen(kitchen),
        anchors=tuple(
            AnchorPlace(f'A{index}', (round(x, 3), round(y, 3), height))
            for index, (x, y) in enumerate(corners)
        ),
        people=(*standing, *_walkers(rng, grid, plan.walkers, kitchen[:2])),
    )
    return DriveRoom(
        seed,
        plan.kind,
        scenario,
        tuple(box.name for box in unknown),
        tuple(tour),
        tuple(closed),
        plan.unknown_start,
    )


def _build(layout: Layout, rng: np.random.Generator, plan: _Plan) -> str | None:
    """Build walls, tables and boxes; return the table behind walls ('': there is no place)."""
    width, depth = layout.size
    behind: str | None = None
    if plan.kind == 'walled in':
        behind = _closet(layout, rng)
    doored = plan.kind in ('door closed', 'door blocked')
    if doored or (plan.kind != 'walled in' and rng.random() < 0.6):
        cut = round(float(rng.uniform(0.4, 0.65)) * width, 3)
        doors = 1 if doored or rng.random() < 0.5 else 2
        add_partition(layout, rng, (cut, 0.0), (cut, depth), doors)
        if doored:
            if not add_table(layout, rng, ((cut, 0.0), layout.size)):
                return ''
            behind = layout.tables[-1].name
        if doored or rng.random() < 0.4:
            across = round(float(rng.uniform(0.4, 0.6)) * depth, 3)
            if min(abs(across - door.middle[1]) for door in layout.doors) > 1.2:
                add_partition(layout, rng, (0.0, across), (cut, across), 1)
        if doored:
            # All other tables on the kitchen's side.
            for _ in range(int(rng.integers(2, 6))):
                add_table(layout, rng, ((0.0, 0.0), (cut, depth)))
    if not doored:
        for _ in range(int(rng.integers(3, 9))):
            add_table(layout, rng)
    for _ in range(int(rng.integers(0, 5))):
        add_box(layout, rng)
    if plan.kind == 'door closed':
        layout.boxes.append(_in_the_door(layout, rng, 'counter in the door'))
    return behind


def _in_the_door(layout: Layout, rng: np.random.Generator, name: str) -> Box:
    """Return a box that stands across the first door and leaves gaps too narrow for the robot."""
    door = layout.doors[0]
    gaps = float(rng.uniform(0.1, 0.4))
    return Box(
        name,
        *door.middle,
        round(door.width - gaps, 3),
        round(float(rng.uniform(0.3, 0.6)), 3),
        round(door.heading, 4),
    )


def _closet(layout: Layout, rng: np.random.Generator) -> str:
    """Wall a corner of the room in, with a table; return its name ('': it finds no place)."""
    width, depth = layout.size
    x, y = (round(float(rng.uniform(2.6, 3.4)), 3) for _ in range(2))
    low = (0.0 if rng.random() < 0.5 else width - x, 0.0 if rng.random() < 0.5 else depth - y)
    low = round(low[0], 3), round(low[1], 3)
    high = round(low[0] + x, 3), round(low[1] + y, 3)
    side = high[0] if low[0] == 0.0 else low[0]
    edge = high[1] if low[1] == 0.0 else low[1]
    from_x = low[0] if low[0] == 0.0 else high[0]
    from_y = low[1] if low[1] == 0.0 else high[1]
    layout.walls.append(Wall(((from_x, edge), (side, edge), (side, from_y)), 'closet'))
    return layout.tables[-1].name if add_table(layout, rng, (low, high)) else ''


def _kitchen(
    layout: Layout, rng: np.random.Generator, grid: RoomGrid
) -> tuple[float, float, float] | None:
    """Return where the robot lives: near a wall, on this side of the partition, with some room."""
    space = layout.radius + 0.35
    free = grid.free(space, 0.0) & (grid.known < space + 0.5)
    if layout.doors:
        free[grid.cell((layout.doors[0].middle[0] - space, 0.0))[0] :] = False
    place = grid.draw(rng, free)
    if place is None:
        return None
    return (*place, round(float(rng.uniform(-math.pi, math.pi)), 3))


def _unknown(
    layout: Layout,
    rng: np.random.Generator,
    plan: _Plan,
    grid: RoomGrid,
    home: Point,
    stops: tuple[Point, ...],
) -> list[Box]:
    """Return what is not on the map: chairs, bags and trolleys, most of them where one drives."""
    boxes = []
    if plan.kind == 'door blocked':
        boxes.append(_in_the_door(layout, rng, 'trolley in the door'))
    ends = (home, *stops)
    for number in range(plan.unknown):
        name, length, width, height = (
            ('chair', 0.45, 0.45, 0.9),
            ('bag', 0.5, 0.3, 0.4),
            ('trolley', 0.9, 0.5, 1.0),
        )[int(rng.integers(3))]
        reach = math.hypot(length, width) / 2.0
        heading = round(float(rng.uniform(0.0, math.pi)), 3)
        taken = [box.outline.corners.mean(axis=0) for box in boxes]
        for _ in range(30):
            place = _spot(rng, grid, ends, reach)
            clear = place is not None and all(
                math.dist(place, end) > reach + layout.radius + 0.35 for end in ends
            )
            if place is None or not clear:
                continue
            if all(math.dist(place, other) > 1.0 for other in taken):
                box = Box(f'{name} {number + 1}', *place, length, width, heading, height)
                boxes.append(box)
                break
    return boxes


def _spot(
    rng: np.random.Generator, grid: RoomGrid, ends: tuple[Point, ...], reach: float
) -> Point | None:
    """Return a free place: near a straight line between two ends three times out of four."""
    if rng.random() < 0.25:
        return grid.draw(rng, grid.known >= reach + 0.03)
    first, second = rng.choice(len(ends), 2, replace=False) if len(ends) > 1 else (0, 0)
    share, aside = float(rng.uniform(0.2, 0.8)), float(rng.uniform(-0.4, 0.4))
    (x0, y0), (x1, y1) = ends[first], ends[second]
    away = max(math.dist(ends[first], ends[second]), 1e-6)
    x = x0 + share * (x1 - x0) - aside * (y1 - y0) / away
    y = y0 + share * (y1 - y0) + aside * (x1 - x0) / away
    place = round(min(max(x, 0.0), grid.size_m[0]), 3), round(min(max(y, 0.0), grid.size_m[1]), 3)
    return place if grid.space_at(place) >= reach + 0.03 else None


def _standing(
    rng: np.random.Generator, grid: RoomGrid, ends: tuple[Point, ...]
) -> tuple[Person, ...]:
    """Return somebody who stands about, now and then."""
    if rng.random() >= _STANDS:
        return ()
    place = _spot(rng, grid, ends, 0.25)
    if place is None or any(math.dist(place, end) < 1.0 for end in ends):
        return ()
    return (Person('standing', (place,)),)


def _as_meant(
    grid: RoomGrid, radius: float, home: Point, open_stops: list[Point], shut_stops: list[Point]
) -> bool:
    """Return whether exactly the stops can be reached that are meant to be, beyond doubt."""
    wide = grid.free(radius + KNOWN_SPACE_M, radius + UNKNOWN_SPACE_M)
    if not all(grid.joined(home, (home, *open_stops), wide)):
        return False
    narrow = grid.free(radius + CLOSED_SPACE_M, radius + CLOSED_SPACE_M)
    return not any(grid.joined(home, tuple(shut_stops), narrow))


def _walkers(
    rng: np.random.Generator, grid: RoomGrid, count: int, home: Point
) -> tuple[Person, ...]:
    """Return people who walk between free places, by straight ways that are free, too."""
    people: list[Person] = []
    for number in range(count):
        child = rng.random() < 0.2
        radius = 0.2 if child else round(float(rng.uniform(0.22, 0.28)), 3)
        space = radius + _WALKER_SPACE_M
        free = grid.free(space, space)
        route = _route(rng, grid, free, space, int(rng.integers(2, 5)))
        if len(route) < 2 or math.dist(route[0], home) < 1.5:
            continue
        people.append(
            Person(
                f'person {number + 1}',
                tuple(route),
                len(route) > 2 and grid.line_is_free(route[-1], route[0], space),
                round(float(rng.uniform(0.4, 1.1)), 3),
                radius,
                1.2 if child else 1.7,
                yield_probability=0.0 if rng.random() < _NEVER_YIELDS else 0.9,
            )
        )
    return tuple(people)


def _route(
    rng: np.random.Generator, grid: RoomGrid, free: Mask, space: float, count: int
) -> list[Point]:
    route: list[Point] = []
    for _ in range(40 * count):
        if len(route) == count:
            break
        place = grid.draw(rng, free)
        if place is None:
            break
        if not route:
            route.append(place)
            continue
        if math.dist(place, route[-1]) >= 1.5 and grid.line_is_free(route[-1], place, space):
            route.append(place)
    return route
