"""The shortest comfortable way through the known room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from tablerunner.config import Config, parameter
from tablerunner.control.floor_map import Disc, FloorMap
from tablerunner.control.path import Path
from tablerunner.errors import ConfigError, NoWayError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Vector

_SNAP_M = 0.5  # how far the start may lie from free floor: localisation is not exact


@dataclass(frozen=True)
class PlannerConfig(Config):
    """What a good way is."""

    resolution: float = parameter(
        0.05, description='Spacing of the planning grid', unit='m', low=0.01, high=0.5
    )
    clearance: float = parameter(
        0.12,
        description='Least distance between hull and obstacle on the way',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    end_clearance: float = parameter(
        0.05,
        description='Least distance between hull and obstacle at start and goal',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    end_radius: float = parameter(
        0.6,
        description='Around start and goal the smaller clearance counts up to here',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    comfort: float = parameter(
        0.45,
        description='Distance between hull and obstacle beyond which more is no better',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    comfort_weight: float = parameter(
        4.0,
        description='How many times longer than free floor touching distance counts, less one',
        low=0.0,
        dynamic=True,
    )

    def check(self) -> None:
        """Keep the end clearance the smaller one."""
        if self.end_clearance > self.clearance:
            raise ConfigError('end_clearance', self.end_clearance, 'at most clearance')


@dataclass(frozen=True, eq=False)
class Planner:
    """Plans ways over one floor for a round robot.

    The grid search is Dijkstra's algorithm of scipy.sparse.csgraph on the 8-connected cells; its
    compiled loop is faster than an A* loop in Python would be with any heuristic. The staircase it
    finds is then straightened where the straight line costs no more. Where something may be, but
    need not, a way is dear and not forbidden. docs/navigation.md.

    Parameters
    ----------
    floor : FloorMap
    footprint_radius : float
        Radius of the robot's hull about base_link [m].
    config : PlannerConfig
    """

    floor: FloorMap
    footprint_radius: float
    config: PlannerConfig = PlannerConfig()

    def configured(self, config: PlannerConfig) -> Planner:
        """Return a planner of the same floor with other settings (the grid stays)."""
        return Planner(self.floor, self.footprint_radius, config)

    def check_goal(self, goal: Pose2) -> None:
        """Raise `PlanningError` in plain words if the robot cannot stand at `goal`."""
        if not goal.is_finite:
            raise PlanningError('the goal is not a finite position and heading')
        where = f'the goal ({goal.x:.2f}, {goal.y:.2f})'
        if not self.floor.contains(goal.x, goal.y):
            raise PlanningError(f'{where} is outside the room')
        distance = float(self.floor.distance_at(np.array([goal.x, goal.y])))
        if distance <= 0.0:
            raise PlanningError(f'{where} is inside an obstacle')
        if distance < self.footprint_radius + self.config.end_clearance:
            raise PlanningError(
                f'{where} is {distance:.2f} m from an obstacle: the robot needs '
                f'{self.footprint_radius + self.config.end_clearance:.2f} m to stand there'
            )

    def plan(
        self,
        start: Pose2,
        goal: Pose2,
        *,
        keep_heading: bool = True,
        blocked: tuple[Disc, ...] = (),
    ) -> Path:
        """Return the way from `start` to `goal`, both in map.

        Parameters
        ----------
        start, goal : Pose2
        keep_heading : bool
            Whether the path asks for the goal's heading.
        blocked : tuple of Disc
            Places where something stands that the floor does not know.

        Raises
        ------
        PlanningError
            The goal is outside the room, in or too near an obstacle; `NoWayError`: no way leads
            there.
        """
        if not start.is_finite:
            raise PlanningError('the start is not a finite position and heading')
        self.check_goal(goal)
        floor = self.floor.with_discs(blocked)
        needed = self._needed(floor, start, goal)
        allowed = floor.distance >= needed
        first = self._start_cell(floor, allowed, start)
        snapped = 1 if first == floor.cell(start.x, start.y) else 0
        last = floor.cell(goal.x, goal.y)
        if not allowed[last]:
            last = self._goal_cell(floor, allowed, goal)
        cells = self._search(floor, allowed, first, last, goal)
        points = np.column_stack(
            [
                floor.origin[0] + floor.resolution * cells[:, 1],
                floor.origin[1] + floor.resolution * cells[:, 0],
            ]
        )
        points = np.concatenate([[[start.x, start.y]], points[snapped:-1], [[goal.x, goal.y]]])
        points = self._straighten(floor, points, start, goal)
        return Path(points, goal.heading if keep_heading else None)

    def _needed(self, floor: FloorMap, start: Pose2, goal: Pose2) -> Vector:
        """Return the distance to obstacles each cell needs, shape (rows, columns)."""
        centres = floor.centres()
        return self._needed_at(centres, start, goal).reshape(floor.shape)

    def _needed_at(self, points: Vector, start: Pose2, goal: Pose2) -> Vector:
        config = self.config
        ends = np.minimum(
            np.hypot(points[..., 0] - start.x, points[..., 1] - start.y),
            np.hypot(points[..., 0] - goal.x, points[..., 1] - goal.y),
        )
        extra = np.where(ends <= config.end_radius, config.end_clearance, config.clearance)
        return np.asarray(self.footprint_radius + extra)

    def _start_cell(
        self, floor: FloorMap, allowed: NDArray[np.bool_], start: Pose2
    ) -> tuple[int, int]:
        cell = floor.cell(start.x, start.y)
        if floor.contains(start.x, start.y) and allowed[cell]:
            return cell
        return self._nearest_allowed(
            floor, allowed, start, _SNAP_M, 'the robot stands where there is no floor to drive on'
        )

    def _goal_cell(
        self, floor: FloorMap, allowed: NDArray[np.bool_], goal: Pose2
    ) -> tuple[int, int]:
        try:
            return self._nearest_allowed(
                floor, allowed, goal, 2 * floor.resolution, 'something stands at the goal'
            )
        except PlanningError as error:
            raise NoWayError(str(error)) from None

    def _nearest_allowed(
        self,
        floor: FloorMap,
        allowed: NDArray[np.bool_],
        pose: Pose2,
        reach: float,
        trouble: str,
    ) -> tuple[int, int]:
        centres = floor.centres()
        away = np.hypot(centres[:, 0] - pose.x, centres[:, 1] - pose.y)
        away[~allowed.ravel()] = np.inf
        best = int(np.argmin(away))
        if not away[best] <= reach:
            raise PlanningError(f'{trouble} ({pose.x:.2f}, {pose.y:.2f})')
        row, column = divmod(best, floor.shape[1])
        return row, column

    def _search(
        self,
        floor: FloorMap,
        allowed: NDArray[np.bool_],
        first: tuple[int, int],
        last: tuple[int, int],
        goal: Pose2,
    ) -> NDArray[np.intp]:
        """Return the cheapest chain of cells, shape (n, 2) as (row, column)."""
        columns = floor.shape[1]
        graph = _graph(allowed, self._cost(self._eased(floor).distance), floor.resolution)
        start, end = first[0] * columns + first[1], last[0] * columns + last[1]
        _, previous = csgraph.dijkstra(graph, indices=start, return_predecessors=True)
        if start != end and previous[end] < 0:
            where = f'({goal.x:.2f}, {goal.y:.2f})'
            if floor.outside[last] and not floor.outside[first]:
                raise PlanningError(f'the goal {where} is outside the room')
            raise NoWayError(f'no way leads to the goal {where}')
        chain = [end]
        while chain[-1] != start:
            chain.append(int(previous[chain[-1]]))
        index = np.array(chain[::-1])
        return np.column_stack(np.divmod(index, columns))

    def _eased(self, floor: FloorMap) -> FloorMap:
        """Return the floor by which places are priced: something may be where nobody looked."""
        return floor.at_ease(self.config.clearance)

    def _cost(self, distance: Vector) -> Vector:
        """Return how much a metre counts at a distance from the nearest obstacle."""
        config = self.config
        hull = np.maximum(distance - self.footprint_radius, 0.0)
        lack = np.clip(1.0 - hull / config.comfort, 0.0, 1.0)
        return np.asarray(1.0 + config.comfort_weight * lack**2)

    def _straighten(self, floor: FloorMap, points: Vector, start: Pose2, goal: Pose2) -> Vector:
        """Drop corners wherever the straight line is allowed and costs no more."""
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        eased = self._eased(floor)
        cost = self._cost(eased.distance_at(points))
        spent = np.concatenate([[0.0], np.cumsum(step * (cost[1:] + cost[:-1]) / 2)])
        kept = [0]
        while kept[-1] < len(points) - 1:
            here = kept[-1]
            ends = points[here + 1 :]
            length = np.linalg.norm(ends - points[here], axis=1)
            count = max(2, math.ceil(float(length.max()) / floor.resolution) + 1)
            share = np.linspace(0.0, 1.0, count)[None, :, None]
            samples = points[here] + share * (ends - points[here])[:, None, :]
            distance = floor.distance_at(samples)
            free = np.all(distance >= self._needed_at(samples, start, goal) - 1e-6, axis=1)
            if eased is not floor:
                distance = eased.distance_at(samples)
            price = length * self._cost(distance).mean(axis=1)
            good = free & (price <= (spent[here + 1 :] - spent[here]) * 1.01 + 1e-9)
            good[0] = True  # the next cell is always a neighbour
            kept.append(here + 1 + int(np.flatnonzero(good)[-1]))
        return np.asarray(points[kept])


def _graph(allowed: NDArray[np.bool_], cost: Vector, resolution: float) -> sparse.csr_matrix:
    """Return the weighted neighbourhood of the allowed cells, 8-connected."""
    rows, columns = allowed.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    sources, targets, weights = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
        there = (slice(down, rows), slice(max(0, right), columns - max(0, -right)))
        both = allowed[here] & allowed[there]
        step = resolution * math.hypot(down, right)
        sources.append(number[here][both])
        targets.append(number[there][both])
        weights.append(step * (cost[here][both] + cost[there][both]) / 2)
    source, target = np.concatenate(sources), np.concatenate(targets)
    weight = np.concatenate(weights)
    return sparse.csr_matrix(
        (
            np.concatenate([weight, weight]),
            (np.concatenate([source, target]), np.concatenate([target, source])),
        ),
        shape=(rows * columns, rows * columns),
    )
