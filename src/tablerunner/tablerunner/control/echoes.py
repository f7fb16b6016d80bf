"""What the ultrasonic sensors have lately heard, kept in the robot's own frame.

An echo tells how far the nearest thing in a cone is, not where in the cone: it may stand anywhere
on the arc. The sensors fire in turn, so what one heard is carried along with the robot's motion
until it fires again, and a little longer because echoes drop out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import NANOSECONDS, Refusal, UltrasonicSample, Vector, Velocity, seconds

_ARC_POINTS = 7
_FUTURE_S = 0.1  # clocks of two machines may differ by this
_CLOSING_M_S = 0.25  # several times what the noise of two readings makes of a thing at rest
_WALKING_M_S = 2.5  # faster than anybody walks in a room: another thing than before
_COMPARE_S = 0.5  # readings farther apart are not compared
_SIDE_RAD = math.radians(60.0)


@dataclass(frozen=True, slots=True)
class _Echo:
    stamp: int
    sensor: str
    points: Vector  # (_ARC_POINTS, 2), dead-reckoned frame, right to left; empty: nothing there
    nearing: bool  # it seemed to come nearer by itself
    confirmed: bool  # the reading before heard the same thing


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
    beside : ndarray of bool, shape (n,)
        Whether a sensor heard it that looks to the side.
    sensors : tuple of str
    """

    points: Vector
    ages_s: Vector
    closing: NDArray[np.bool_]
    nearing: NDArray[np.bool_]
    beside: NDArray[np.bool_]
    sensors: tuple[str, ...]


class EchoMemory:
    """The last echoes of each sensor, moved with the robot.

    A flat thing met at a slant mirrors the sound away, so silence does not prove that what was
    heard has gone: an echo is kept for a while although the sensor does not hear it again, for
    longer when it is near.

    Parameters
    ----------
    mounts : dict of str to Pose2
        Pose of each sensor in base_link, by frame name.
    hold_s, hold_near_s : float
        How long an echo counts although the sensor has fired again without it [s].
    near_m : float
        Distance from base_link up to which `hold_near_s` counts [m].
    """

    def __init__(
        self, mounts: dict[str, Pose2], hold_s: float, hold_near_s: float, near_m: float
    ) -> None:
        self.mounts = dict(mounts)
        self._beside = {
            name: abs(difference(mount.heading, 0.0)) >= _SIDE_RAD
            for name, mount in mounts.items()
        }
        self.configure(hold_s, hold_near_s, near_m)
        self._motion = Velocity()
        self._pose = Pose2()  # of base_link in a frame of its own, dead-reckoned
        self._echoes: list[_Echo] = []
        self._last: dict[str, _Echo] = {}
        self._closing_until: dict[str, int] = {}
        self._nearing_until: dict[str, int] = {}

    def configure(self, hold_s: float, hold_near_s: float, near_m: float) -> None:
        """Use other times from now on."""
        self._hold_s, self._hold_near_s, self._near_m = hold_s, hold_near_s, near_m

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
        speed = self._closing_m_s(sample, points)
        closing = speed > _CLOSING_M_S
        nearing = closing and speed < math.inf
        last = self._last.get(sample.sensor)
        # Twice in a row: one step nearer may be the edge of another thing.
        if nearing and last is not None and last.nearing:
            self._nearing_until[sample.sensor] = sample.stamp + NANOSECONDS // 2
        if closing:
            self._closing_until[sample.sensor] = sample.stamp + NANOSECONDS
        points = self._pose.transform(points)
        echo = _Echo(sample.stamp, sample.sensor, points, nearing, 0.0 <= speed < math.inf)
        self._echoes.append(echo)
        self._last[sample.sensor] = echo
        return None

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

    def _closing_m_s(self, sample: UltrasonicSample, points: Vector) -> float:
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
        # A flat thing at rest that stands at a slant to the way seems to come nearer, too: to a
        # side sensor as fast as the robot passes it, to those between the less.
        passing = abs(self._motion.linear_m_s) * math.sin(mount.heading) ** 2
        sweeping = abs(self._motion.angular_rad_s) * before_m
        return max(speed - passing - sweeping, 0.0)

    def move(self, motion: Velocity, dt: float) -> None:
        """Carry the echoes along while the robot drives with `motion` for `dt` [s]."""
        self._motion = motion
        if dt <= 0.0:
            return
        turn = motion.angular_rad_s * dt
        step = motion.linear_m_s * dt
        self._pose = self._pose @ Pose2(step * math.cos(turn / 2), step * math.sin(turn / 2), turn)

    def forget(self, now: int) -> None:
        """Drop what is older than the hold times, but never the last reading of a sensor."""
        self._echoes = [echo for echo in self._echoes if self._counts(echo, now)]

    def _counts(self, echo: _Echo, now: int) -> bool:
        if echo.stamp == self._last[echo.sensor].stamp:
            return True
        if not len(echo.points):
            return False
        age_s = seconds(now - echo.stamp)
        if age_s <= self._hold_s or not echo.confirmed:
            return age_s <= self._hold_s
        x, y = echo.points[len(echo.points) // 2]
        away_m = math.hypot(float(x) - self._pose.x, float(y) - self._pose.y)
        return age_s <= self._hold_near_s and away_m <= self._near_m

    def age_s(self, sensor: str, now: int) -> float:
        """Return how long ago a sensor was last heard [s]; inf: never."""
        last = self._last.get(sensor)
        return math.inf if last is None else seconds(now - last.stamp)

    def heard(self, now: int) -> Heard | None:
        """Return what counts now; None: nothing."""
        kept = [echo for echo in self._echoes if len(echo.points)]
        if not kept:
            return None
        count = [len(echo.points) for echo in kept]
        ages = [max(seconds(now - echo.stamp), 0.0) for echo in kept]
        # An older echo that is still held is taken for a thing at rest: the newer reading tells
        # of what moves.
        newest = [echo.stamp == self._last[echo.sensor].stamp for echo in kept]
        closing = [
            new and self._closing_until.get(echo.sensor, 0) > now
            for new, echo in zip(newest, kept, strict=True)
        ]
        nearing = [
            new and self._nearing_until.get(echo.sensor, 0) > now
            for new, echo in zip(newest, kept, strict=True)
        ]
        return Heard(
            self._pose.inverse().transform(np.concatenate([echo.points for echo in kept])),
            np.repeat(ages, count),
            np.repeat(closing, count),
            np.repeat(nearing, count),
            np.repeat([self._beside[echo.sensor] for echo in kept], count),
            tuple(echo.sensor for echo in kept for _ in range(len(echo.points))),
        )

    def reset(self) -> None:
        """Forget everything (time went back)."""
        self._echoes = []
        self._last = {}
        self._closing_until = {}
        self._nearing_until = {}
