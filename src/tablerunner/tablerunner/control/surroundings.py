"""What the ultrasonic sensors have found on the floor that the map does not show.

A grid of evidence (Moravec and Elfes, "High resolution maps from wide angle sonar", 1985) on the
cells of the floor map: an echo speaks for something on the arc on which it may lie, and against
anything in the cone before it. Echoes that the map explains are left out. What is not confirmed
is forgotten, for most of what is not on the map walks away; what stood for a while, slowly.

Only the near face of a thing is heard. How far something that stands reaches behind that nobody
knows until sound has passed there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablerunner.config import Config, parameter
from tablerunner.control.floor_map import FloorMap
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.path import Path
from tablerunner.errors import ConfigError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Vector, seconds

_FADE_EVERY_S = 1.0
_ARC_M = 0.06  # half the thickness of the arc of an echo
_ROUGH_M = 0.05  # the map is no more exact than that
_BEFORE_M = 0.15  # so far before an echo nothing stands
_SPACING_M = 0.1
_FAR_M = 1.0  # what is farther from a path than this is of no interest
_ELSEWHERE = 0.15
_BLUR_M = 0.08  # places are found wider than they are
_MOST_PASSES = 2.0  # times as many as are needed are remembered
_SILENT_SHARE = 0.2  # of silence: sound passes there, or has been mirrored away
_COMPARED_S = 0.4  # readings farther apart than this are not compared
_AHEAD_RAD = math.radians(60.0)
_BESIDE_SHARE, _SUDDEN_SHARE = 1.5, 0.6
_SUDDEN_M = 0.3  # nearer than before by more than anything at rest that the robot passes by
_TURNED_RAD = 0.1
_RUNNING_M_S = 2.5  # nearer by more: another thing than before


@dataclass(frozen=True)
class SurroundingsConfig(Config):
    """How what is found is weighed."""

    reach: float = parameter(
        1.5, description='What is heard farther away tells nothing of a place', unit='m', above=0.0
    )
    sharp: float = parameter(
        0.8,
        description='Up to here an echo counts whole; farther away its arc is wide',
        unit='m',
        above=0.0,
    )
    explained: float = parameter(
        0.1,
        description='An echo is of the map when something on it is so near the arc',
        unit='m',
        low=0.0,
    )
    explained_deviations: float = parameter(
        3.0,
        description='The same in standard deviations of the position, where that is more',
        low=0.0,
    )
    explained_most: float = parameter(
        0.25, description='The same at most, however uncertain the pose', unit='m', low=0.0
    )
    passed: float = parameter(
        0.5, description='What speaks against a place that sound has passed', low=0.0
    )
    silent: float = parameter(
        0.2,
        description='The same where nothing echoed: sound may have been mirrored away',
        low=0.0,
    )
    silent_firm: float = parameter(
        0.25, description='By how much less silence speaks against furniture', low=0.0, high=1.0
    )
    enough: float = parameter(
        1.5, description='Whole echoes that make something of a place', above=0.0
    )
    most: float = parameter(4.0, description='No more echoes than these are remembered', above=0.0)
    depth: float = parameter(
        0.35,
        description='So near to what stands there may be more of it, where no sound has passed',
        unit='m',
        low=0.0,
    )
    stands: float = parameter(
        2.0, description='What was heard for so long stands', unit='s', low=0.0
    )
    passes: float = parameter(
        2.0, description='Echoes from beyond a place that show that nothing was there', above=0.0
    )
    fade_time: float = parameter(
        15.0, description='Time constant of forgetting', unit='s', above=0.0
    )
    firm: float = parameter(
        5.0,
        description='What was heard for so long is furniture, and forgotten slowly',
        unit='s',
        low=0.0,
    )
    firm_fade_time: float = parameter(
        40.0, description='Time constant of forgetting furniture', unit='s', above=0.0
    )
    shy: float = parameter(
        0.6, description='Who comes nearer than this by himself is waited for', unit='m', low=0.0
    )
    walking: float = parameter(
        0.35, description='Coming nearer faster than this is walking', unit='m/s', above=0.0
    )
    yield_time: float = parameter(
        0.8, description='Wait so long after somebody has come nearer', unit='s', low=0.0
    )
    opening: float = parameter(
        0.48, description='Full opening of the cones', unit='rad', above=0.0, high=3.0
    )

    def check(self) -> None:
        """Keep the bounds in their order."""
        if self.explained > self.explained_most:
            raise ConfigError('explained', self.explained, 'at most explained_most')
        if self.stands > self.firm:
            raise ConfigError('stands', self.stands, 'at most firm')


class Surroundings:
    """Evidence for things that are not on the map; deterministic.

    Parameters
    ----------
    floor : FloorMap
        What is on the map.
    mounts : tuple of Pose2
        Poses of the sensors in base_link, in the order of the readings.
    config : SurroundingsConfig, optional
    """

    def __init__(
        self,
        floor: FloorMap,
        mounts: tuple[Pose2, ...],
        config: SurroundingsConfig | None = None,
    ) -> None:
        self.config = config or SurroundingsConfig()
        self._map = floor
        self._mounts = mounts
        self._half_tangent = math.tan(self.config.opening / 2.0)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._evidence = np.zeros(self._map.shape)
        self._passed = np.zeros(self._map.shape)  # echoes from beyond
        self._firm_s = np.zeros(self._map.shape)  # for how long something was heard there
        self._heard = np.zeros(self._map.shape, dtype=bool)  # since it was last faded
        self._ages = [math.inf] * len(self._mounts)
        self._last: int | None = None
        self._fade_s = 0.0
        self._before: list[tuple[int, float, Pose2] | None] = [None] * len(self._mounts)
        self._approached: int | None = None
        self._floor: FloorMap | None = self._map  # None: to be made anew

    def hear(
        self, readings: Readings, pose: Pose2, stamp: int, std_m: float = 0.0
    ) -> tuple[float, ...]:
        """Take what is new in `readings`; `pose` is base_link in map at `stamp` [ns].

        `std_m` is the standard deviation of its position [m].

        Returns
        -------
        tuple of float
            How near it is to what the map does not explain, by new echoes, each by how soon it may
            matter [m].
        """
        config = self.config
        off_m = max(config.explained, config.explained_deviations * std_m)
        off_m = min(off_m, config.explained_most)
        unknown: list[float] = []
        dt = 0.0 if self._last is None else max(seconds(stamp - self._last), 0.0)
        self._last = stamp
        self._fade(dt)
        for sensor, (distance, age) in enumerate(
            zip(readings.distances_m, readings.ages_s, strict=True)
        ):
            # The same reading has grown older by dt; a new one is younger than that.
            is_new = age < self._ages[sensor] + 0.5 * dt
            self._ages[sensor] = age
            if is_new and age < 0.5 and not math.isnan(distance):
                at = pose @ self._mounts[sensor]
                known_m = self._add(distance, at, off_m)
                if known_m > off_m:
                    self._compare(sensor, distance, at, stamp)
                if known_m > off_m + _ROUGH_M:
                    unknown.append(self._share(sensor, distance, stamp) * distance)
                self._before[sensor] = stamp, distance, at
        return tuple(unknown)

    def _share(self, sensor: int, distance: float, stamp: int) -> float:
        """Return what share of its distance something that is not on the map is taken to be off.

        Who comes from beside comes at a slant, and is as far again; but one who has just come into
        a cone that looks there may be walking fast, and meet a robot that has no time left.
        """
        before = self._before[sensor]
        if abs(self._mounts[sensor].heading) < _AHEAD_RAD:
            return 1.0
        if before is None or seconds(stamp - before[0]) > _COMPARED_S:
            return _SUDDEN_SHARE
        return _SUDDEN_SHARE if before[1] - distance > _SUDDEN_M else _BESIDE_SHARE

    def _compare(self, sensor: int, distance: float, at: Pose2, stamp: int) -> None:
        """Take note of what comes nearer by itself, faster than the robot moves towards it."""
        config, before = self.config, self._before[sensor]
        if before is None or distance > config.shy or before[1] == math.inf:
            return
        apart_s = seconds(stamp - before[0])
        if not 0.0 < apart_s <= _COMPARED_S:
            return
        if abs(difference(at.heading, before[2].heading)) > _TURNED_RAD:
            return  # the cone has swept to another thing
        cos, sin = math.cos(at.heading), math.sin(at.heading)
        own = (at.x - before[2].x) * cos + (at.y - before[2].y) * sin
        speed = (before[1] - distance - own) / apart_s
        if config.walking < speed < _RUNNING_M_S:
            self._approached = stamp

    def is_approached(self, stamp: int) -> bool:
        """Return whether somebody who is not on the map has just come nearer by himself."""
        if self._approached is None:
            return False
        return seconds(stamp - self._approached) < self.config.yield_time

    def _fade(self, dt: float) -> None:
        self._fade_s += dt
        if self._fade_s < _FADE_EVERY_S:
            return
        config = self.config
        slowly = self._firm_s >= config.firm
        times = np.where(slowly, config.firm_fade_time, config.fade_time)
        self._evidence *= np.exp(-self._fade_s / times)
        self._passed *= math.exp(-self._fade_s / config.firm_fade_time)  # a thing may be put there
        heard_s = np.where(self._heard, self._fade_s, 0.0)
        self._firm_s = np.where(self.found, self._firm_s + heard_s, 0.0)
        self._heard[:] = False
        self._fade_s = 0.0
        self._floor = None

    def _add(self, distance: float, at: Pose2, off_m: float) -> float:
        """Weigh one reading, `at` is the sensor in map, which may be off by `off_m`.

        Returns how far what was heard is from anything on the map [m]; 0: nothing was heard.
        """
        config, floor = self.config, self._map
        far = min(distance, config.reach)
        row, column = floor.cell(at.x, at.y)
        half = math.ceil((far + _ARC_M) / floor.resolution)
        rows = slice(max(row - half, 0), max(row + half + 1, 0))
        columns = slice(max(column - half, 0), max(column + half + 1, 0))
        evidence = self._evidence[rows, columns]
        if not evidence.size:
            return 0.0
        xs = floor.origin[0] + floor.resolution * np.arange(
            columns.start, columns.start + evidence.shape[1]
        )
        ys = floor.origin[1] + floor.resolution * np.arange(
            rows.start, rows.start + evidence.shape[0]
        )
        dx, dy = xs[None, :] - at.x, ys[:, None] - at.y
        cos, sin = math.cos(at.heading), math.sin(at.heading)
        along = dx * cos + dy * sin
        aside = np.abs(dy * cos - dx * sin) / np.maximum(along * self._half_tangent, 1e-9)
        in_cone = (aside <= 1.0) & (along > 0.0)
        away = np.hypot(dx, dy)
        against = config.silent if distance == math.inf else config.passed
        before = in_cone & (away < far - _BEFORE_M)
        middle = 1.0 - aside[before] ** 2  # less at the edges, which sound may miss
        passed = self._passed[rows, columns]
        share = _SILENT_SHARE if distance == math.inf else 1.0
        passed[before] = np.minimum(passed[before] + share * middle, _MOST_PASSES * config.passes)
        lost = against * middle
        if distance == math.inf:  # sound is mirrored away from furniture
            firm = self._firm_s[rows, columns][before] >= config.firm
            lost *= np.where(firm, config.silent_firm, 1.0)
        evidence[before] = np.maximum(evidence[before] - lost, 0.0)
        self._floor = None
        if distance > config.reach:
            return 0.0
        arc = in_cone & (np.abs(away - distance) <= _ARC_M)
        known = floor.distance[rows, columns][arc]
        known_m = float(known.min()) if known.size else 0.0
        if known_m <= off_m:
            return known_m
        # Sound is strongest in the middle of the cone. At its edges an echo rather speaks against
        # something: once is enough to explain it.
        weight = min(1.0, config.sharp / max(distance, 1e-6))
        share = (1.0 - aside[arc] ** 2) ** 2 - _ELSEWHERE
        evidence[arc] = np.clip(evidence[arc] + weight * share, 0.0, config.most)
        self._heard[rows, columns] |= arc & (evidence >= config.enough)
        return known_m

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which cells of the floor hold something that the map does not show."""
        return np.asarray(self._evidence >= self.config.enough)

    @property
    def floor(self) -> FloorMap:
        """The floor with what was found on it."""
        if self._floor is None:
            found, floor = self.found, self._map
            self._floor = floor
            if found.any():
                away = _distance(found, floor)
                self._floor = FloorMap(
                    floor.origin,
                    floor.resolution,
                    np.minimum(floor.distance, np.where(found, 0.0, away + _BLUR_M)),
                    floor.outside,
                    self._unseen(found),
                )
        return self._floor

    def _unseen(self, found: NDArray[np.bool_]) -> Vector | None:
        """Return how far each cell is from where what was found may reach [m]; None: nowhere."""
        config = self.config
        stands = found & (self._firm_s >= config.stands)
        if not stands.any():
            return None
        unseen = _distance(stands, self._map) <= config.depth
        unseen &= self._passed < config.passes
        return _distance(unseen, self._map) if unseen.any() else None

    def gap(self, path: Path, begin: float, length: float) -> float:
        """Return how near what was found is to a part of a path [m]; inf: nothing was.

        Parameters
        ----------
        path : Path
        begin, length : float
            The part, as length along the path [m].
        """
        cells = np.argwhere(self.found)
        if not len(cells):
            return math.inf
        places = self._map.origin + self._map.resolution * cells[:, ::-1]
        end = min(begin + length, path.length)
        arcs = np.linspace(begin, end, max(2, math.ceil((end - begin) / _SPACING_M) + 1))
        points = np.column_stack([np.interp(arcs, path.arc, path.points[:, k]) for k in (0, 1)])
        low, high = points.min(axis=0) - _FAR_M, points.max(axis=0) + _FAR_M
        places = places[np.all((places >= low) & (places <= high), axis=1)]
        if not len(places):
            return math.inf
        away2 = np.sum((points[:, None, :] - places[None]) ** 2, axis=-1)
        return math.sqrt(away2.min())


def _distance(cells: NDArray[np.bool_], floor: FloorMap) -> Vector:
    """Return how far each cell is from the nearest of some [m]."""
    return np.asarray(ndimage.distance_transform_edt(~cells, sampling=floor.resolution))
