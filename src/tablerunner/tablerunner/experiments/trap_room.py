"""Rooms with traps: a robot that goes straight for the target is caught in them.

All rooms are Lv's, 10 m x 10 m with the target at (8, 8), traps of boards 0.1 m thick. The trap
stands between start and target and opens, within 0.45 rad, towards the start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import Path, Planner, PlannerConfig, floor_map
from tablerunner.errors import ConfigError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Box, Scenario, Wall

Array = NDArray[np.float64]
Line = tuple[tuple[float, float], ...]

SIDE_M = 10.0
TARGET = (8.0, 8.0)
TRAPS = ('U', 'L', 'G', 'double')
CLOSED = ('start closed', 'target closed')
"""Rooms in which there is no way: walls all round the start, or round the target."""
KINDS = ('empty', 'box', *TRAPS, *CLOSED)

_CLOSED_TARGET = (6.2, 6.2)  # with way to pass all round the boards
_BOARD_M = 0.1
_PASSAGE_M = 1.5  # every way through is at least so wide
_ROOM_AT_ENDS_M = 0.9  # start and target are at least so far from every wall
_TRIES = 500


@dataclass(frozen=True, eq=False)
class TrapRoom:
    """One room.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    scenario : Scenario
    target : tuple of float
        x, y in map [m].
    shortest : Path or None
        The shortest way of the hull, by `tablerunner.control.Planner`; None where there is none.
    """

    kind: str
    scenario: Scenario
    target: tuple[float, float]
    shortest: Path | None


def make_trap_room(kind: str, seed: int) -> TrapRoom:
    """Return a room of a kind; the same seed gives the same room.

    Sizes, place and direction of the trap, start and its heading are drawn until start and target
    have room, every passage is wide enough (a way with half of `_PASSAGE_M` to all sides exists),
    and the trap cuts the straight line. In a closed room they are drawn until there is no way.

    Raises
    ------
    ConfigError
        The kind is not known.
    """
    if kind not in KINDS:
        raise ConfigError('kind', kind, 'one of ' + ', '.join(KINDS))
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    for _ in range(_TRIES):
        room = _try(kind, seed, rng)
        if room is not None:
            return room
    raise RuntimeError(f'no room of kind {kind} with seed {seed}')  # never seen


def _try(kind: str, seed: int, rng: np.random.Generator) -> TrapRoom | None:
    start = rng.uniform(1.2, 2.8, 2)
    target = np.array(_CLOSED_TARGET if kind == 'target closed' else TARGET)
    heading = math.atan2(target[1] - start[1], target[0] - start[0])
    toward = heading + float(rng.uniform(-0.45, 0.45))
    centre = start + float(rng.uniform(0.35, 0.8)) * (target - start)
    boxes: tuple[Box, ...] = ()
    walls: list[Wall] = []
    if kind == 'box':
        length, width = rng.uniform(0.5, 1.4, 2)
        turned = float(rng.uniform(-math.pi, math.pi))
        boxes = (Box('box', float(centre[0]), float(centre[1]), length, width, turned),)
    elif kind != 'empty':
        if kind in CLOSED:
            centre = start if kind == 'start closed' else target
        frame = Pose2(float(centre[0]), float(centre[1]), toward)
        lines = [frame.transform(np.array(line)) for line in _shape(kind, rng)]
        if kind in ('U', 'L') and rng.random() < 0.5:
            lines.append(_wing(lines[0][1:3]))
        if any(line.min() < 0.0 or line.max() > SIDE_M for line in lines):
            return None
        walls = [_wall(f'trap {i}', line) for i, line in enumerate(lines, 1)]
    ends = np.array([start, target])
    things = [wall.outline.segments for wall in walls] + [box.outline.segments for box in boxes]
    if things and distance_to_segments(ends, np.concatenate(things)).min() < _ROOM_AT_ENDS_M:
        return None
    outer = Wall(((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M)), 'room', True)
    scenario = Scenario(
        name=f'{kind} {seed}',
        walls=(outer, *walls),
        boxes=boxes,
        start=(float(start[0]), float(start[1]), float(rng.uniform(-math.pi, math.pi))),
    )
    goal = float(target[0]), float(target[1])
    shortest = shortest_way(scenario, goal, 0.02)
    if kind in CLOSED:
        return TrapRoom(kind, scenario, goal, None) if shortest is None else None
    wide = shortest_way(scenario, goal, _PASSAGE_M / 2.0 - scenario.robot.footprint_radius)
    if shortest is None or wide is None:
        return None
    if kind != 'empty' and shortest.length < math.dist(start, target) + 0.02:
        return None
    return TrapRoom(kind, scenario, goal, shortest)


def _shape(kind: str, rng: np.random.Generator) -> tuple[Line, ...]:
    """Return the walls in the trap's frame: x towards the target, its middle at 0, 0 [m]."""
    width, depth = float(rng.uniform(1.8, 3.4)), float(rng.uniform(1.4, 2.4))
    v, u = width / 2.0, depth / 2.0
    mirror = 1.0 if rng.random() < 0.5 else -1.0
    flare_1, flare_2 = depth * np.tan(rng.uniform(-0.1, 0.7, 2))
    cup = ((-u, -v - flare_1), (u, -v), (u, v), (-u, v + flare_2))
    if kind == 'U':
        return (cup,)
    if kind == 'L':
        v += 0.5
        return (((-u, (v + flare_1) * mirror), (u, v * mirror), (u, -v * mirror)),)
    if kind == 'G':  # a lip across the opening, and its end turned in
        v = max(v, 1.3)
        lip = 2.0 * v - _PASSAGE_M - float(rng.uniform(0.0, 0.3))
        inward = float(rng.uniform(0.2, 0.5))
        hook = ((-u, v - lip), (-u + inward, v - lip))
        line = ((-u, -v - flare_1), (u, -v), (u, v), (-u, v), *hook)
        return (tuple((x, y * mirror) for x, y in line),)
    if kind == 'double':
        u, v = min(u, 0.9), min(v, 1.2)
        cup = ((-u, -v), (u, -v), (u, v), (-u, v))
        if rng.random() < 0.5:  # one behind the other, shifted
            aside = float(rng.uniform(-0.8, 0.8))
            apart = u + _PASSAGE_M / 2.0 + 0.1
            return (
                tuple((x - apart, y) for x, y in cup),
                tuple((x + apart, y + aside) for x, y in cup),
            )
        big_u, big_v = u + _PASSAGE_M + _BOARD_M, v + _PASSAGE_M + _BOARD_M  # one in the other
        outer = ((-u, -big_v), (big_u, -big_v), (big_u, big_v), (-u, big_v))
        return (cup, outer)
    half = float(rng.uniform(1.0, 1.3))
    return (((-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)),)


def _wall(name: str, line: Array) -> Wall:
    """Return the outline of boards along a polyline, shape (n, 2), with mitred corners.

    One that ends where it began has no end that could be met, and is left without thickness.
    """
    if np.allclose(line[0], line[-1]):
        return Wall(_points(line[:-1]), name, True)
    along = np.diff(line, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    before, after = np.concatenate([left[:1], left]), np.concatenate([left, left[-1:]])
    mitre = (before + after) / (1.0 + np.sum(before * after, axis=1))[:, None]
    half = _BOARD_M / 2.0 * mitre
    return Wall(_points(np.concatenate([line + half, (line - half)[::-1]])), name, True)


def _wing(base: Array) -> Array:
    """Return a partition that goes on from the second corner of the base to the room's wall."""
    end, along = base[1], base[1] - base[0]
    along = along / np.linalg.norm(along)
    room = np.where(along > 0.0, SIDE_M - end, end) / np.maximum(np.abs(along), 1e-9)
    return np.array([end + _BOARD_M * along, end + (room.min() - _BOARD_M) * along])


def _points(points: Array) -> Line:
    return tuple((float(x), float(y)) for x, y in points)


def shortest_way(scenario: Scenario, target: tuple[float, float], clearance: float) -> Path | None:
    """Return the shortest way of the hull to a target, kept `clearance` [m] from everything.

    Nothing is added for being near: that is for comfort.
    """
    config = PlannerConfig(
        clearance=clearance, end_clearance=min(clearance, 0.02), comfort_weight=0.0
    )
    planner = Planner(floor_map(scenario), scenario.robot.footprint_radius, config)
    try:
        return planner.plan(scenario.start_pose, Pose2(*target), keep_heading=False)
    except PlanningError:
        return None
