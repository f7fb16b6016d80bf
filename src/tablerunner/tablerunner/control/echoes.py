"""What the ultrasonic sensors have lately heard, kept in the robot's own frame.

An echo tells how far the nearest thing in a cone is, not where in the cone: it may stand anywhere
on the arc. The sensors fire in turn, so what one heard is carried along with the robot's motion
until it fires again, and a little longer because echoes drop out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import NANOSECONDS, Refusal, UltrasonicSample, Vector, Velocity, seconds

_ARC_POINTS = 7
_FUTURE_S = 0.1  # clocks of two machines may differ by this
_CLOSING_M_S = 0.25  # several times what the noise of two readings makes of a thing at rest
_LEAST_PACE_M_S = 0.12  # more than noise makes of a thing at rest over three readings
_WALKING_M_S = 2.5  # faster than anybody walks in a room: another thing than before
_COMPARE_S = 0.5  # readings farther apart are not compared
_SIDE_RAD = math.radians(60.0)
_SHARP_M = 0.7
_WALKER_NS = 10 * NANOSECONDS
_BEYOND_M = 0.15  # something nearer by this than the echo would have been heard
_ENOUGH_MISSES = 2
_STANDING_SHARE = 0.25  # of the time that passes while the robot stands counts for its memory
_STANDS_M_S, _STANDS_RAD_S = 0.01, 0.02
_INSIDE_M = 0.02  # deeper inside the hull than noise and motion put what touches it


@dataclass(frozen=True, slots=True)
class EchoTimes:
    """How long an echo counts that its sensor does not hear again.

    Attributes
    ----------
    hold_s : float
        Any echo [s].
    near_s : float
        One that was heard twice and is near [s].
    memory_s : float
        One that was heard twice and not from afar, as long as no sensor looks there and hears
        nothing; time at which the robot stands counts a quarter [s].
    near_m : float
        Distance from base_link that is near [m].
    hull_m : float
        Radius of the hull about base_link [m]: nothing is where the robot itself has been since.
    """

    hold_s: float
    near_s: float
    memory_s: float
    near_m: float
    hull_m: float = 0.0


@dataclass(frozen=True, slots=True)
class _Reading:
    """The last reading of one sensor."""

    stamp: int
    points: Vector  # (_ARC_POINTS, 2), dead-reckoned frame; empty: nothing there
    speed_m_s: float  # at which it came nearer by itself for sure; inf, -inf as in _coming_m_s
    seen_m_s: float  # at which it came nearer by itself if it is no flat thing at a slant

    @property
    def nearing(self) -> bool:
        """Whether it seemed to walk up to the robot."""
        return _CLOSING_M_S < self.speed_m_s < math.inf


@dataclass(frozen=True, slots=True)
class Heard:
    """Where something may be: one row for each point of each echo that counts.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        In base_link [m].
    ages_s : ndarray, shape (n,)
        Since they were heard [s].
    closing : ndarray of bool, shape (n,)
        Whether it came nearer by itself, or has only just appeared.
    nearing : ndarray of bool, shape (n,)
        Whether it was measured to come nearer by itself, at walking pace.
    paces_m_s : ndarray, shape (n,)
        How fast it came nearer by itself over the last three readings; 0 when at rest. Something
        flat at a slant ahead may seem to.
    beside : ndarray of bool, shape (n,)
        Whether a sensor heard it that looks to the side.
    sensors : ndarray of str, shape (n,)
    """

    points: Vector
    ages_s: Vector
    closing: NDArray[np.bool_]
    nearing: NDArray[np.bool_]
    paces_m_s: Vector
    beside: NDArray[np.bool_]
    sensors: NDArray[np.str_]


class EchoMemory:
    """The last echoes of each sensor, moved with the robot.

    A flat thing met at a slant mirrors the sound away, so silence does not prove that what was
    heard has gone; and a corner that was heard ahead leaves the cone before the robot is there. So
    echoes are remembered, the longer the likelier they are to be true and to matter (`EchoTimes`).

    Parameters
    ----------
    mounts : dict of str to Pose2
        Pose of each sensor in base_link, by frame name.
    times : EchoTimes
    """

    def __init__(self, mounts: dict[str, Pose2], times: EchoTimes) -> None:
        self.mounts = dict(mounts)
        self.times = times
        self._names = tuple(mounts)
        self._names_by_number = np.array(self._names)
        self._beside = np.array(
            [abs(difference(mount.heading, 0.0)) >= _SIDE_RAD for mount in mounts.values()]
        )
        self.reset()

    def reset(self) -> None:
        """Forget everything (time went back)."""
        self._motion = Velocity()
        self._pose = Pose2()  # of base_link in a frame of its own, dead-reckoned
        self._last: dict[str, _Reading] = {}
        self._closing_until: dict[str, int] = {}
        self._nearing_until: dict[str, int] = {}
        self._paces: dict[str, float] = {}
        # One row for each point of each echo that is remembered.
        self._points = np.empty((0, 2))  # in the dead-reckoned frame
        self._stamps = np.empty(0, dtype=np.int64)
        self._sensors = np.empty(0, dtype=np.int64)  # index in _names
        self._confirmed = np.empty(0, dtype=bool)  # the reading before heard the same thing
        self._sharp = np.empty(0, dtype=bool)  # and near enough to say where it is
        self._misses = np.empty(0, dtype=np.int64)  # readings that looked there and heard nothing
        self._heard_at = np.empty(0)  # by the clock of memory
        # A robot that stands loses no track of where things are, and may be held up by one that no
        # cone covers: it must not forget that and drive on.
        self._clock_s = 0.0

    def add(self, sample: UltrasonicSample, now: int) -> Refusal | None:
        """Take one reading.

        inf is a reading: nothing echoed. -inf (REP-117: too close to measure) and anything below
        the least range count as touching the sensor. NaN and numbers up to zero are no readings:
        they are refused, and a sensor that sends only such falls silent.
        """
        reason = self._fault(sample, now)
        if reason is not None:
            return Refusal(sample.stamp, f'ultrasonic/{sample.sensor}', sample.sensor, reason)
        # The echoes at hand are in the frame of now; at walking pace the few milliseconds between
        # firing and arrival do not matter, and the age is charged to whoever approaches.
        points = self._arc(sample)
        coming = self._coming_m_s(sample, points)
        speed = coming
        if math.isfinite(coming):
            speed = max(coming - self._passing_m_s(sample.sensor), 0.0)
        number = self._names.index(sample.sensor)
        seen_m_s = speed if self._beside[number] else coming
        last = self._last.get(sample.sensor)
        reading = _Reading(sample.stamp, points, speed, seen_m_s)
        # Twice in a row: one step nearer may be the edge of another thing.
        if reading.nearing and last is not None and last.nearing:
            self._nearing_until[sample.sensor] = sample.stamp + NANOSECONDS // 2
        pace = math.nan if last is None else 0.5 * (seen_m_s + last.seen_m_s)
        self._paces[sample.sensor] = pace if _LEAST_PACE_M_S < pace < math.inf else 0.0
        if speed > _CLOSING_M_S:
            self._closing_until[sample.sensor] = sample.stamp + NANOSECONDS
        points = self._pose.transform(points)
        self._contradict(sample)
        count = len(points)
        self._points = np.concatenate([self._points, points])
        self._stamps = np.append(self._stamps, np.full(count, sample.stamp))
        self._sensors = np.append(self._sensors, np.full(count, number))
        confirmed = 0.0 <= speed < math.inf
        self._confirmed = np.append(self._confirmed, np.full(count, confirmed))
        # Farther away the arc is so wide that most of it is where nothing stands; and who came
        # walking will go away again.
        walked = self._nearing_until.get(sample.sensor)
        walking = walked is not None and sample.stamp < walked + _WALKER_NS
        sharp = confirmed and sample.range_m <= _SHARP_M and not walking
        self._sharp = np.append(self._sharp, np.full(count, sharp))
        self._misses = np.append(self._misses, np.zeros(count, dtype=np.int64))
        self._heard_at = np.append(self._heard_at, np.full(count, self._clock_s))
        self._last[sample.sensor] = replace(reading, points=points)
        return None

    def _contradict(self, sample: UltrasonicSample) -> None:
        """Count a miss for each remembered point in the cone that is nearer than what is heard."""
        if not len(self._points):
            return
        at = self._pose @ self.mounts[sample.sensor]
        seen = at.inverse().transform(self._points)
        reach = min(sample.range_m, sample.max_range_m) - _BEYOND_M
        nearer = np.hypot(seen[:, 0], seen[:, 1]) < reach
        bearing = np.abs(np.arctan2(seen[:, 1], seen[:, 0]))
        # The ends of an arc lie on the very edge of the cone.
        self._misses[nearer & (bearing <= sample.field_of_view_rad / 2.0 + 0.02)] += 1

    def _fault(self, sample: UltrasonicSample, now: int) -> str | None:
        if sample.sensor not in self.mounts:
            return 'unknown sensor'
        if math.isnan(sample.range_m):
            return 'range is not a number'
        if sample.range_m <= 0.0 and sample.range_m != -math.inf:
            return 'range is not positive'
        if sample.stamp <= 0:
            return 'no stamp'
        if seconds(sample.stamp - now) > _FUTURE_S:
            return 'stamp in the future'
        last = self._last.get(sample.sensor)
        if last is not None and sample.stamp <= last.stamp:
            return 'stamp not after the last'
        if not (math.isfinite(sample.field_of_view_rad) and sample.field_of_view_rad >= 0.0):
            return 'field of view is not a finite angle'
        return None

    def _arc(self, sample: UltrasonicSample) -> Vector:
        top = sample.max_range_m if sample.max_range_m > 0 else math.inf
        if sample.range_m >= top or sample.range_m == math.inf:
            return np.empty((0, 2))
        near = sample.min_range_m if math.isfinite(sample.min_range_m) else 0.0
        distance = 0.0 if sample.range_m < near else sample.range_m
        half = min(sample.field_of_view_rad, math.pi) / 2.0
        angles = np.linspace(-half, half, _ARC_POINTS)
        local = distance * np.column_stack([np.cos(angles), np.sin(angles)])
        return self.mounts[sample.sensor].transform(local)

    def _coming_m_s(self, sample: UltrasonicSample, points: Vector) -> float:
        """Return how fast what is heard comes nearer beyond the robot's own motion [m/s].

        inf: nothing was heard there before, or another thing; -inf: nothing is heard.
        """
        if not len(points):
            return -math.inf
        last = self._last.get(sample.sensor)
        if last is None or not len(last.points):
            return math.inf
        apart_s = seconds(sample.stamp - last.stamp)
        if apart_s > _COMPARE_S:
            return math.inf
        mount = self.mounts[sample.sensor]
        place = np.array([mount.x, mount.y])
        now_m = float(np.linalg.norm(points[0] - place))
        # The nearest point of the old arc: where in the cone the echo came from is not known.
        old = self._pose.inverse().transform(last.points)
        before_m = float(np.min(np.linalg.norm(old - place, axis=1)))
        speed = (before_m - now_m) / apart_s
        if speed > _WALKING_M_S:
            return math.inf
        return speed - abs(self._motion.angular_rad_s) * before_m

    def _passing_m_s(self, sensor: str) -> float:
        """Return how fast a flat thing at rest may seem to come nearer.

        One that stands at a slant to the way does: to a side sensor as fast as the robot passes
        it, to those between the less.
        """
        return abs(self._motion.linear_m_s) * math.sin(self.mounts[sensor].heading) ** 4

    def move(self, motion: Velocity, dt: float) -> None:
        """Carry the echoes along while the robot drives with `motion` for `dt` [s]."""
        self._motion = motion
        if dt <= 0.0:
            return
        stands = abs(motion.linear_m_s) < _STANDS_M_S and abs(motion.angular_rad_s) < _STANDS_RAD_S
        self._clock_s += dt * (_STANDING_SHARE if stands else 1.0)
        turn = motion.angular_rad_s * dt
        step = motion.linear_m_s * dt
        self._pose = self._pose @ Pose2(step * math.cos(turn / 2), step * math.sin(turn / 2), turn)

    def forget(self, now: int) -> None:
        """Drop what no longer counts, but never the last reading of a sensor."""
        if not len(self._points):
            return
        times = self.times
        age = (now - self._stamps) / NANOSECONDS
        away = np.hypot(self._points[:, 0] - self._pose.x, self._points[:, 1] - self._pose.y)
        newest = self._is_newest()
        lately = self._clock_s - self._heard_at
        kept = age <= times.hold_s
        kept |= self._confirmed & (away <= times.near_m) & (age <= times.near_s)
        kept |= self._sharp & (self._misses < _ENOUGH_MISSES) & (lately <= times.memory_s)
        kept &= away >= times.hull_m - _INSIDE_M
        kept |= newest
        if not kept.all():
            self._points, self._stamps = self._points[kept], self._stamps[kept]
            self._sensors, self._confirmed = self._sensors[kept], self._confirmed[kept]
            self._sharp, self._misses = self._sharp[kept], self._misses[kept]
            self._heard_at = self._heard_at[kept]

    def _is_newest(self) -> NDArray[np.bool_]:
        last = np.array(
            [self._last[name].stamp if name in self._last else 0 for name in self._names]
        )
        return np.asarray(self._stamps == last[self._sensors])

    def age_s(self, sensor: str, now: int) -> float:
        """Return how long ago a sensor was last heard [s]; inf: never."""
        last = self._last.get(sensor)
        return math.inf if last is None else seconds(now - last.stamp)

    def heard(self, now: int) -> Heard | None:
        """Return what counts now; None: nothing."""
        if not len(self._points):
            return None
        # An older echo that is still held is taken for a thing at rest: the newer reading tells
        # of what moves.
        newest = self._is_newest()
        closing = np.array([self._closing_until.get(name, 0) > now for name in self._names])
        nearing = np.array([self._nearing_until.get(name, 0) > now for name in self._names])
        paces = np.array([self._paces.get(name, 0.0) for name in self._names])
        return Heard(
            self._pose.inverse().transform(self._points),
            np.maximum((now - self._stamps) / NANOSECONDS, 0.0),
            newest & closing[self._sensors],
            newest & nearing[self._sensors],
            np.where(newest, paces[self._sensors], 0.0),
            self._beside[self._sensors],
            self._names_by_number[self._sensors],
        )
