"""What stands in a random room: walls with doors, tables, boxes.

Rooms are drawn piece by piece; a piece that finds no place is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from tablerunner.geometry.segments import crosses, distance_to_segments
from tablerunner.scenario import Box, Outline, Table, Wall

Point = tuple[float, float]

STOP_GAP_M = (0.17, 0.4)
"""Free space between hull and table where the robot delivers."""

_FROM_WALL_M = 0.08
_DOOR_M = (1.1, 1.8)
_DOOR_CLEAR_M = 1.0
_TRIES = 60


@dataclass(frozen=True)
class Door:
    """An opening in a partition: its middle, the wall's direction [rad], its width [m]."""

    middle: Point
    heading: float
    width: float


@dataclass
class Layout:
    """A room while it is drawn, from (0, 0) to `size`.

    Attributes
    ----------
    size : tuple of float
        [m]
    radius : float
        Of the robot's hull [m].
    walls, tables, boxes, doors : list
    """

    size: tuple[float, float]
    radius: float
    walls: list[Wall] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    doors: list[Door] = field(default_factory=list)

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """Footprints of everything so far."""
        return (
            *(wall.outline for wall in self.walls),
            *(table.outline for table in self.tables),
            *(box.outline for box in self.boxes),
        )

    def fits(self, outline: Outline, gap: float) -> bool:
        """Return whether a thing finds place, `gap` [m] from what stands there already."""
        low, high = outline.corners.min(axis=0), outline.corners.max(axis=0)
        if np.any(low < _FROM_WALL_M) or np.any(high > np.array(self.size) - _FROM_WALL_M):
            return False
        for door in self.doors:
            if _distance(np.array([door.middle]), outline) < _DOOR_CLEAR_M:
                return False
        for other in self.outlines:
            edges = outline.segments
            if np.any(crosses(edges[:, 0], edges[:, 1], other.segments)):
                return False
            if np.any(other.contains(outline.corners)) or np.any(outline.contains(other.corners)):
                return False
            least = _FROM_WALL_M if other.kind == 'wall' else gap
            if _distance(outline.corners, other) < least:
                return False
            if _distance(other.corners, outline) < least:
                return False
        return True


def _distance(points: np.ndarray, outline: Outline) -> float:
    if outline.is_solid and bool(np.any(outline.contains(points))):
        return 0.0
    return float(np.min(distance_to_segments(points, outline.segments)))


def outer_wall(size: tuple[float, float]) -> Wall:
    """Return the wall round the room."""
    width, depth = size
    corners = ((0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth))
    return Wall(corners, 'outer wall', closed=True)


def add_partition(
    layout: Layout, rng: np.random.Generator, start: Point, end: Point, doors: int
) -> None:
    """Add a wall from `start` to `end` with openings."""
    height = 2.6 if rng.random() < 0.5 else 1.4
    a, b = np.array(start), np.array(end)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    heading = math.atan2(along[1], along[0])
    name = f'partition {len(layout.walls)}'
    at = 0.0
    for number in range(doors):
        width = float(rng.uniform(*_DOOR_M))
        low, high = number * length / doors + 0.4, (number + 1) * length / doors - 0.4 - width
        left = float(rng.uniform(low, high)) if high > low else low
        if left > at + 0.05:
            layout.walls.append(_wall(a, along, at, left, f'{name}.{number}', height))
        middle = a + along * (left + width / 2.0)
        layout.doors.append(Door(_point(middle), heading, width))
        at = left + width
    if length > at + 0.05:
        layout.walls.append(_wall(a, along, at, length, f'{name}.{doors}', height))


def _wall(
    start: np.ndarray, along: np.ndarray, low: float, high: float, name: str, height: float
) -> Wall:
    ends = _point(start + along * low), _point(start + along * high)
    return Wall(ends, name, height=height)


def _point(xy: np.ndarray) -> Point:
    return round(float(xy[0]), 3), round(float(xy[1]), 3)


def add_table(
    layout: Layout,
    rng: np.random.Generator,
    within: tuple[Point, Point] | None = None,
) -> bool:
    """Add a table with its stop somewhere (between two corners); return whether it found place."""
    low, high = within or ((0.0, 0.0), layout.size)
    name = f'table_{len(layout.tables) + 1}'
    for _ in range(_TRIES):
        x, y = (round(float(rng.uniform(a, b)), 3) for a, b in zip(low, high, strict=True))
        heading = round(
            float(rng.integers(4) * math.pi / 2 + rng.choice([0.0, 1.0]) * rng.uniform(-0.6, 0.6)),
            4,
        )
        is_round = bool(rng.random() < 0.4)
        length = round(float(rng.uniform(0.7, 1.4) if is_round else rng.uniform(0.8, 2.0)), 3)
        width = round(float(rng.uniform(0.7, 1.1)), 3)
        stop = _stop(rng, layout.radius, (x, y, heading), is_round, length, width)
        table = Table(
            name, x, y, stop, 'round' if is_round else 'rectangle', heading, length, width
        )
        inside = all(a + 0.45 < s < b - 0.45 for a, s, b in zip(low, stop[:2], high, strict=True))
        if not inside or not layout.fits(table.outline, float(rng.uniform(0.3, 1.3))):
            continue
        if all(_free_stop(layout, item, table) for item in (*layout.tables, table)):
            layout.tables.append(table)
            return True
    return False


def _stop(
    rng: np.random.Generator,
    radius: float,
    place: tuple[float, float, float],
    is_round: bool,
    length: float,
    width: float,
) -> tuple[float, float, float]:
    """Return x, y, heading where the robot delivers: beside one edge of the table."""
    x, y, heading = place
    away = radius + float(rng.uniform(*STOP_GAP_M))
    if is_round:
        side = float(rng.uniform(-math.pi, math.pi))
        out, aside = length / 2.0 / math.cos(math.pi / 16.0) + away, 0.0
    else:
        turn = int(rng.integers(4))
        side = heading + turn * math.pi / 2.0
        deep, wide = (length, width) if turn % 2 == 0 else (width, length)
        out, aside = deep / 2.0 + away, float(rng.uniform(-0.35, 0.35)) * wide
    to_x = x + out * math.cos(side) - aside * math.sin(side)
    to_y = y + out * math.sin(side) + aside * math.cos(side)
    looks = side + float(rng.choice([math.pi / 2.0, -math.pi / 2.0, math.pi]))
    looks = math.remainder(looks, math.tau)
    return round(to_x, 3), round(to_y, 3), round(looks, 4)


def _free_stop(layout: Layout, table: Table, new: Table) -> bool:
    """Return whether the stop of one table is clear of everything and of a new table."""
    place = np.array([table.stop[:2]])
    needed = layout.radius + STOP_GAP_M[0] - 0.01
    return all(_distance(place, outline) >= needed for outline in (*layout.outlines, new.outline))


def add_box(layout: Layout, rng: np.random.Generator) -> bool:
    """Add a pillar, a counter or a plant that is on the map; return whether it found place."""
    kind = ('pillar', 'counter', 'plant')[int(rng.integers(3))]
    for _ in range(_TRIES):
        x, y = (round(float(rng.uniform(0.3, side - 0.3)), 3) for side in layout.size)
        heading = float(rng.integers(2) * math.pi / 2)
        length = width = float(rng.uniform(0.3, 0.5))
        if kind == 'counter':
            length, width = float(rng.uniform(1.0, 2.2)), float(rng.uniform(0.4, 0.7))
        if kind == 'plant':
            heading = float(rng.uniform(0.0, math.pi))
        height = 2.6 if kind == 'pillar' else 1.0
        box = Box(
            f'{kind} {len(layout.boxes) + 1}',
            x,
            y,
            round(length, 3),
            round(width, 3),
            round(heading, 4),
            height,
        )
        stops = np.array([table.stop[:2] for table in layout.tables]).reshape(-1, 2)
        clear = layout.radius + STOP_GAP_M[0]
        if len(stops) and min(_distance(stop[None], box.outline) for stop in stops) < clear:
            continue
        if layout.fits(box.outline, float(rng.uniform(0.3, 1.3))):
            layout.boxes.append(box)
            return True
    return False
