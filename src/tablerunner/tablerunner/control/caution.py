"""How fast it is wise to drive where somebody may step into the way.

The safety stop minds what it hears. Somebody who steps from behind a door post is heard too late
for that, and whoever stands beside the way may set off at any moment. So the mission asks for less
speed where the map hides a place to walk, beside what the map does not explain, and for a while
after somebody came nearer: between the cones of the sensors others may come unheard.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.config import Config, parameter
from tablerunner.control.braking import largest_speed
from tablerunner.control.floor_map import FloorMap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Vector, Velocity, seconds

_SPACING_M = 0.1  # of the places that are looked at
_SIGHT_M = 0.07  # of the samples along a line of sight
_CLOSE_M, _CLOSE_SHARE = 0.3, 0.5  # beside who walks so near it creeps
_WALKS_S = 5.0
_WALL_M = 0.03  # a line of sight that comes so near to something ends there


@dataclass(frozen=True)
class CautionConfig(Config):
    """Whom the robot expects, and how quickly it stands."""

    pace: float = parameter(
        0.9,
        description='Speed of somebody who may step into the way; 0: nobody is expected',
        unit='m/s',
        low=0.0,
        high=3.0,
        dynamic=True,
    )
    hidden_pace: float = parameter(
        0.9,
        description='The same for somebody who comes from where the map hides the floor',
        unit='m/s',
        low=0.0,
        high=3.0,
        dynamic=True,
    )
    body: float = parameter(
        0.2, description='Radius of somebody who walks', unit='m', above=0.0, dynamic=True
    )
    delay: float = parameter(
        0.2, description='From somebody in sight to the brakes biting', unit='s', low=0.0
    )
    deceleration: float = parameter(
        0.8, description='Deceleration that is counted on', unit='m/s^2', above=0.0
    )
    least_speed: float = parameter(
        0.12,
        description='Never slower than this, or the robot would not get on at all',
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    hold: float = parameter(
        0.7, description='How long what was heard counts', unit='s', low=0.0, dynamic=True
    )
    busy_speed: float = parameter(
        0.35,
        description='Largest speed where somebody has come nearer lately',
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    busy_time: float = parameter(
        60.0, description='How long that is lately', unit='s', low=0.0, dynamic=True
    )


class Caution:
    """Tells the largest wise speed; deterministic.

    Parameters
    ----------
    floor : FloorMap
        What is on the map.
    footprint_radius : float
        Radius of the robot's hull [m].
    config : CautionConfig, optional
    """

    def __init__(
        self, floor: FloorMap, footprint_radius: float, config: CautionConfig | None = None
    ) -> None:
        self.config = config or CautionConfig()
        self._floor = floor
        self._radius = footprint_radius
        self._heard: list[tuple[int, float]] = []
        self._met: int | None = None

    def meet(self, stamp: int) -> None:
        """Take note that somebody comes nearer by himself."""
        self._met = stamp

    def hear(self, stamp: int, gap: float) -> None:
        """Take note of something ahead that is not on the map, `gap` [m] from the hull."""
        self._heard.append((stamp, gap))

    def slowed(self, velocity: Velocity, pose: Pose2, stamp: int) -> Velocity:
        """Return `velocity` at the largest wise speed, on the same arc."""
        linear = velocity.linear_m_s
        if linear <= self.config.least_speed * _CLOSE_SHARE:
            return velocity
        share = min(self.top_speed(pose, stamp) / linear, 1.0)
        return Velocity(linear * share, velocity.angular_rad_s * share)

    def top_speed(self, pose: Pose2, stamp: int) -> float:
        """Return the largest wise speed with base_link at `pose` in map at `stamp` [ns]."""
        config = self.config
        top = math.inf
        self._heard = [
            (at, gap) for at, gap in self._heard if 0.0 <= seconds(stamp - at) <= config.hold
        ]
        if self._heard and config.pace > 0.0:
            gap = min(gap for _, gap in self._heard)
            top = float(largest_speed(gap, config.delay, config.deceleration, config.pace))
        if config.hidden_pace > 0.0:
            gap = self.hidden_gap(pose)
            if gap < math.inf:
                wise = largest_speed(gap, config.delay, config.deceleration, config.hidden_pace)
                top = min(top, float(wise))
        if self._met_within(config.busy_time, stamp):
            top = min(top, config.busy_speed)
        return max(top, self._least(stamp))

    def _met_within(self, time_s: float, stamp: int) -> bool:
        """Return whether somebody has come nearer within that time."""
        return self._met is not None and 0.0 <= seconds(stamp - self._met) < time_s

    def _least(self, stamp: int) -> float:
        """Return the speed at which the robot gets on in any case."""
        close = self._met_within(_WALKS_S, stamp) and any(gap < _CLOSE_M for _, gap in self._heard)
        return self.config.least_speed * (_CLOSE_SHARE if close else 1.0)

    def hidden_gap(self, pose: Pose2) -> float:
        """Return how near somebody may be who cannot be seen, hull to body [m]; inf: nobody.

        Looked at is the floor before the robot on which somebody has room and to which no straight
        line leads from the robot past all that is on the map.
        """
        config, floor = self.config, self._floor
        reach = self._reach()
        count = math.ceil(reach / _SPACING_M)
        steps = _SPACING_M * np.arange(-count, count + 1)
        xs, ys = (values.ravel() for values in np.meshgrid(pose.x + steps, pose.y + steps))
        away = np.hypot(xs - pose.x, ys - pose.y)
        ahead = (xs - pose.x) * math.cos(pose.heading) + (ys - pose.y) * math.sin(pose.heading)
        looked = (away <= reach) & (ahead > self._radius * 0.5)
        xs, ys, away = xs[looked], ys[looked], away[looked]
        roomy = (_nearest(floor, xs, ys) >= config.body) & ~_outside(floor, xs, ys)
        xs, ys, away = xs[roomy], ys[roomy], away[roomy]
        if not len(xs):
            return math.inf
        shares = np.arange(1, math.ceil(reach / _SIGHT_M)) * (_SIGHT_M / reach)
        line_x = pose.x + shares * (xs - pose.x)[:, None]
        line_y = pose.y + shares * (ys - pose.y)[:, None]
        hidden = np.any(_nearest(floor, line_x, line_y) <= _WALL_M, axis=1)
        if not hidden.any():
            return math.inf
        return float(np.min(away[hidden])) - self._radius - config.body

    def _reach(self) -> float:
        """Return from where on somebody is too far away to matter, centre to centre [m]."""
        config = self.config
        speed = 0.7
        gap = speed * config.delay + 0.5 * speed**2 / config.deceleration
        gap += config.hidden_pace * (config.delay + speed / config.deceleration)
        return gap + self._radius + config.body


def _nearest(floor: FloorMap, xs: Vector, ys: Vector) -> Vector:
    """Return the distance to the nearest obstacle of the cells of some points [m]; 0 beside."""
    rows, columns, inside = _cells(floor, xs, ys)
    return np.asarray(np.where(inside, floor.distance[rows, columns], 0.0))


def _outside(floor: FloorMap, xs: Vector, ys: Vector) -> NDArray[np.bool_]:
    """Return which points lie outside the room."""
    rows, columns, inside = _cells(floor, xs, ys)
    return np.asarray(~inside | floor.outside[rows, columns])


def _cells(
    floor: FloorMap, xs: Vector, ys: Vector
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Return rows and columns of some points, and which of them lie on the grid at all."""
    columns = np.rint((xs - floor.origin[0]) / floor.resolution).astype(np.intp)
    rows = np.rint((ys - floor.origin[1]) / floor.resolution).astype(np.intp)
    inside = (rows >= 0) & (rows < floor.shape[0]) & (columns >= 0) & (columns < floor.shape[1])
    return np.where(inside, rows, 0), np.where(inside, columns, 0), inside
