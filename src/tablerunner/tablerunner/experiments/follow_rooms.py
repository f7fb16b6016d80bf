"""Rooms in which a person is followed: an open hall, others who cross, a table, a partition."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from tablerunner.scenario import (
    AnchorMount,
    Person,
    PersonTag,
    RobotGeometry,
    Scenario,
    SensorErrors,
    Table,
    Wall,
)

SIDE_M = 10.0
TAG = PersonTag(id='host_tag')
ROBOT = RobotGeometry(
    anchors=tuple(
        AnchorMount(id=f'R{index}', position=(x, y, 1.0))
        for index, (x, y) in enumerate(
            ((0.17, 0.17), (-0.17, 0.17), (-0.17, -0.17), (0.17, -0.17))
        )
    )
)
"""Four anchors on the rim of the robot, 0.34 m apart (Bae: 0.5 m)."""

SPEEDS_M_S = (0.3, 0.5)
_HURRIES_M_S = (0.75, 0.9)  # faster than the robot may go: it falls behind
_BEHIND_M = 1.2
_HULL = Wall(
    points=((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M)),
    name='hull',
    closed=True,
)

Points = tuple[tuple[float, float], ...]


def open_hall(seed: int) -> Scenario:
    """Return an empty hall; the host walks round and round a crooked hexagon, with pauses."""
    return _hall('open', _hexagon(seed), seed)


def crossed_hall(seed: int) -> Scenario:
    """Return the same with two others who cross at walking pace."""
    rng = np.random.default_rng([seed, 1])
    others = []
    for index in range(2):
        while True:
            ends = rng.uniform(0.8, SIDE_M - 0.8, size=(2, 2))
            if math.dist(*ends) > 4.0:
                break
        others.append(
            Person(
                name=f'other {index}',
                route=tuple((float(x), float(y)) for x, y in ends),
                speed=float(rng.uniform(0.5, 0.9)),
                start_share=float(rng.uniform(0.0, 1.0)),
            )
        )
    return _hall('others', _hexagon(seed), seed, tuple(others))


def table_hall(seed: int) -> Scenario:
    """Return a hall with a table in the middle, which the host walks round 0.9 m from it."""
    rng = np.random.default_rng([seed, 2])
    length, width = (float(value) for value in rng.uniform(1.0, 2.0, size=2))
    x, y, middle = length / 2 + 0.9, width / 2 + 0.9, SIDE_M / 2
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    route = tuple((middle + dx, middle + dy) for dx, dy in corners)
    table = Table(name='table', x=middle, y=middle, length=length, width=width, stop=(1, 1, 0))
    return _hall('table', route, seed).replace(tables=(table,))


def partitioned_hall(seed: int) -> Scenario:
    """Return a hall with a partition that no signal passes; the host hurries round its end.

    The host goes on faster than the robot, stays behind the partition for a while and comes back.
    """
    rng = np.random.default_rng([seed, 3])
    end = float(rng.uniform(3.8, 4.4))
    partition = Wall(points=((5.0, SIDE_M), (5.0, end)), name='partition')
    low = end - 1.8
    route = ((2.5, 7.5), (2.5, low), (7.5, low), (7.5, 8.0))
    host = Person(
        name='host',
        route=route,
        speed=float(rng.uniform(*_HURRIES_M_S)),
        start_share=0.15,
        pause=4.0,
        pause_probability=0.6,
        tag=TAG,
    )
    errors = SensorErrors()
    return Scenario(
        name='partition',
        walls=(_HULL, partition),
        people=(host,),
        start=(2.5, 7.5, -math.pi / 2),
        robot=ROBOT,
        sensors=errors.replace(uwb=errors.uwb.replace(nlos_loss_probability=1.0)),
    )


ROOMS: Mapping[str, Callable[[int], Scenario]] = MappingProxyType(
    {
        'open floor': open_hall,
        'others cross': crossed_hall,
        'round a table': table_hall,
        'behind a partition': partitioned_hall,
    }
)


def _hexagon(seed: int) -> Points:
    rng = np.random.default_rng([seed, 0])
    angles = np.linspace(0.0, 2.0 * math.pi, 6, endpoint=False) + rng.uniform(-0.3, 0.3, 6)
    radii = rng.uniform(2.5, 4.0, 6)
    turn = 1.0 if rng.random() < 0.5 else -1.0
    return tuple(
        (
            SIDE_M / 2 + float(radius * math.cos(turn * angle)),
            SIDE_M / 2 + float(radius * math.sin(turn * angle)),
        )
        for radius, angle in zip(radii, angles, strict=True)
    )


def _hall(name: str, route: Points, seed: int, others: tuple[Person, ...] = ()) -> Scenario:
    """Return a hall whose host begins a little way ahead of the robot on a closed route."""
    rng = np.random.default_rng([seed, 4])
    around = sum(math.dist(here, there) for here, there in pairwise((*route, route[0])))
    (x, y), (to_x, to_y) = route[:2]
    host = Person(
        name='host',
        route=route,
        loop=True,
        speed=float(rng.uniform(*SPEEDS_M_S)),
        start_share=_BEHIND_M / around,
        pause_probability=0.3,
        tag=TAG,
    )
    return Scenario(
        name=name,
        walls=(_HULL,),
        people=(host, *others),
        start=(x, y, math.atan2(to_y - y, to_x - x)),
        robot=ROBOT,
    )
