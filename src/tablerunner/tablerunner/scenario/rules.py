"""What must hold between the things of a scenario.

Each rule raises `ConfigError` with the field that is wrong; the loader adds file and line.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError
from tablerunner.geometry.segments import crosses, distance_to_segments
from tablerunner.scenario.member import hue_of
from tablerunner.scenario.outline import Outline

if TYPE_CHECKING:
    from tablerunner.scenario.scenario import Scenario

_ROUTE_STEP_M = 0.05
_ANCHOR_SPREAD_M = 0.05

_HUES_APART_DEG = 36.0
"""Two colours nearer than this are one to ceiling_camera, as it is set by default."""


def check_scenario(scenario: Scenario) -> None:
    """Check a scenario; raise `ConfigError` for the first thing that cannot be."""
    _check_names(scenario)
    _check_anchors(scenario)
    _check_things(scenario)
    _check_stops(scenario)
    _check_people(scenario)
    _check_tags(scenario)
    _check_routes(scenario)
    _check_camera(scenario)
    _check_robots(scenario)


def _once(field: str, names: Iterable[str], key: str) -> None:
    seen: set[str] = set()
    for index, name in enumerate(names):
        if not name:
            raise ConfigError(f'{field}[{index}].{key}', name, 'a word')
        if name in seen:
            raise ConfigError(f'{field}[{index}].{key}', name, f'each {key} once')
        seen.add(name)


def _check_names(scenario: Scenario) -> None:
    _once('anchors', (anchor.id for anchor in scenario.anchors), 'id')
    _once('tables', (table.name for table in scenario.tables), 'name')
    _once('boxes', (box.name for box in scenario.boxes), 'name')
    _once('people', (person.name for person in scenario.people), 'name')
    _once('robots', (member.name for member in scenario.robots), 'name')
    if scenario.kitchen is not None:
        for index, table in enumerate(scenario.tables):
            if table.name == scenario.kitchen.name:
                raise ConfigError(
                    f'tables[{index}].name', table.name, 'another name than the kitchen'
                )


def _check_anchors(scenario: Scenario) -> None:
    for (_, first), (index, second) in itertools.combinations(enumerate(scenario.anchors), 2):
        if np.allclose(first.position, second.position, atol=1e-6):
            raise ConfigError(
                f'anchors[{index}].position',
                list(second.position),
                f'another place than anchor {first.id}',
            )


def _check_things(scenario: Scenario) -> None:
    """Refuse solid things outside the room, in a wall or in each other."""
    walls = [wall.outline for wall in scenario.walls]
    solids = [(f'tables[{index}]', table.outline) for index, table in enumerate(scenario.tables)]
    solids += [(f'boxes[{index}]', box.outline) for index, box in enumerate(scenario.boxes)]
    for path, solid in solids:
        centre = np.round(solid.corners.mean(axis=0), 3).tolist()
        if walls and not _inside_room(scenario, solid.corners):
            raise ConfigError(path, centre, 'a place inside the outer walls')
        for wall in walls:
            if _overlap(solid, wall):
                raise ConfigError(path, centre, f'a place clear of the {wall.name}')
    for (_, first), (path, second) in itertools.combinations(solids, 2):
        if _overlap(first, second):
            centre = np.round(second.corners.mean(axis=0), 3).tolist()
            raise ConfigError(path, centre, f'a place clear of {first.name}')


def _inside_room(scenario: Scenario, points: NDArray[np.float64]) -> bool:
    corners = np.concatenate([wall.outline.corners for wall in scenario.walls])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(np.all((points >= low) & (points <= high)))


def _overlap(first: Outline, second: Outline) -> bool:
    edges, others = first.segments, second.segments
    return bool(
        np.any(crosses(edges[:, 0], edges[:, 1], others))
        or np.any(first.contains(second.corners))
        or np.any(second.contains(first.corners))
    )


def _check_clear(
    scenario: Scenario, field: str, points: NDArray[np.float64], radius: float, value: object
) -> None:
    """Refuse points where something of a radius cannot stand."""
    if scenario.walls and not _inside_room(scenario, points):
        raise ConfigError(field, value, 'a place inside the outer walls')
    for outline in scenario.outlines:
        near = float(np.min(distance_to_segments(points, outline.segments)))
        if np.any(outline.contains(points)) or near < radius:
            raise ConfigError(
                field, value, f'a place at least {radius:g} m clear of {outline.name}'
            )


def _check_stops(scenario: Scenario) -> None:
    places = [(f'tables[{i}].stop', table.stop) for i, table in enumerate(scenario.tables)]
    if scenario.kitchen is not None:
        places.append(('kitchen.stop', scenario.kitchen.stop))
    if scenario.start is not None:
        places.append(('start', scenario.start))
    places += [(f'robots[{i}].start', member.start) for i, member in enumerate(scenario.robots)]
    for field, place in places:
        radius = scenario.robot.footprint_radius
        _check_clear(scenario, field, np.array([place[:2]]), radius, list(place))


def _check_people(scenario: Scenario) -> None:
    for index, person in enumerate(scenario.people):
        points = list(person.route)
        legs = list(itertools.pairwise(points))
        if person.loop and len(points) > 1:
            legs.append((points[-1], points[0]))
        _check_clear(
            scenario, f'people[{index}].route[0]', np.array(points[:1]), person.radius, points[0]
        )
        for leg, (here, there) in enumerate(legs):
            start, end = np.array(here), np.array(there)
            count = int(np.linalg.norm(end - start) / _ROUTE_STEP_M) + 2
            way = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
            where = (leg + 1) % len(points)
            value = f'the way {list(here)} to {list(there)}'
            _check_clear(scenario, f'people[{index}].route[{where}]', way, person.radius, value)


def _check_tags(scenario: Scenario) -> None:
    """Refuse tags and anchors that answer to one name, and tags that no anchors can locate."""
    taken = {scenario.tag_id: 'tag_id'}
    taken.update({anchor.id: f'anchors[{i}].id' for i, anchor in enumerate(scenario.anchors)})
    for index, member in enumerate(scenario.robots):
        if member.tag in taken and taken[member.tag] != 'tag_id':
            field = f'robots[{index}].tag_id'
            raise ConfigError(field, member.tag, f'another name than {taken[member.tag]}')
        taken[member.tag] = f'robots[{index}].tag_id'
    names = [(f'robot.anchors[{i}].id', item.id) for i, item in enumerate(scenario.robot.anchors)]
    names += [
        (f'people[{i}].tag.id', person.tag.id)
        for i, person in enumerate(scenario.people)
        if person.tag is not None
    ]
    for field, name in names:
        if not name or name in taken:
            other = f'another name than {taken[name]}' if name else 'a word'
            raise ConfigError(field, name, other)
        taken[name] = field
    places = np.array([item.position[:2] for item in scenario.robot.anchors]).reshape(-1, 2)
    worn = [i for i, person in enumerate(scenario.people) if person.tag is not None]
    if worn and np.linalg.matrix_rank(places - places[:1], tol=_ANCHOR_SPREAD_M) < 2:
        raise ConfigError(
            'robot.anchors',
            [list(item.position) for item in scenario.robot.anchors],
            f'three anchors not in one line, to locate the tag of people[{worn[0]}]',
        )


def _check_routes(scenario: Scenario) -> None:
    for name, points in scenario.routes.items():
        if len(points) < 2:
            raise ConfigError(f'routes.{name}', list(points), 'at least two points')
        for index, point in enumerate(points):
            radius = scenario.robot.footprint_radius
            _check_clear(
                scenario, f'routes.{name}[{index}]', np.array([point]), radius, list(point)
            )


def _check_camera(scenario: Scenario) -> None:
    """Refuse a camera that hangs outside the room, or below what it should see."""
    if scenario.camera is None:
        return
    place = scenario.camera.position
    if scenario.walls and not _inside_room(scenario, np.array([place[:2]])):
        raise ConfigError('camera.position', list(place), 'a place inside the outer walls')
    below = [(person.name, person.height) for person in scenario.people]
    if scenario.robot.marker is not None:
        below.append(("the robot's marker", scenario.robot.marker.height))
    for name, height in below:
        if height >= place[2]:
            raise ConfigError(
                'camera.position[2]', place[2], f'a height above {name} ({height:g} m) [m]'
            )


def _check_robots(scenario: Scenario) -> None:
    """Refuse robots on each other, of one colour, and several that carry anchors."""
    if scenario.robots and scenario.robot.anchors:
        ids = [item.id for item in scenario.robot.anchors]
        raise ConfigError('robot.anchors', ids, 'none where there are several robots')
    marker = scenario.robot.marker
    apart = 2.0 * scenario.robot.footprint_radius
    for (_, first), (index, second) in itertools.combinations(enumerate(scenario.robots), 2):
        if first.start_pose.distance_to(second.start_pose) < apart:
            raise ConfigError(
                f'robots[{index}].start',
                list(second.start),
                f'a place at least {apart:g} m from that of {first.name}',
            )
        if marker is None:
            continue
        colours = [member.colour or marker.colour for member in (first, second)]
        off = abs((hue_of(colours[0]) - hue_of(colours[1]) + 180.0) % 360.0 - 180.0)
        if off < _HUES_APART_DEG:
            raise ConfigError(
                f'robots[{index}].colour',
                list(colours[1]),
                f'a hue at least {_HUES_APART_DEG:g} degrees from that of {first.name} '
                f'({off:.0f} degrees off)',
            )
