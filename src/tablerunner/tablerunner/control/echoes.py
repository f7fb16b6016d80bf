"""What the ultrasonic sensors have lately heard, kept in the robot's own frame.

An echo tells how far the nearest thing in a cone is, not where in the cone: it may stand anywhere
on the arc. The sensors fire in turn, so what one heard is carried along with the robot's motion
until it fires again, and a little longer because echoes drop out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.geometry.pose import Pose2
from tablerunner.types import Refusal, UltrasonicSample, Vector, Velocity, seconds

_ARC_POINTS = 7
_FUTURE_S = 0.1  # clocks of two machines may differ by this


@dataclass(frozen=True, slots=True)
class _Echo:
    stamp: int
    sensor: str
    points: Vector  # (_ARC_POINTS, 2) in base_link; empty: nothing was there


class EchoMemory:
    """The last echoes of each sensor, moved with the robot.

    Parameters
    ----------
    mounts : dict of str to Pose2
        Pose of each sensor in base_link, by frame name.
    hold_s : float
        How long an echo counts although the sensor has fired again without it [s].
    """

    def __init__(self, mounts: dict[str, Pose2], hold_s: float) -> None:
        self.mounts = dict(mounts)
        self.hold_s = hold_s
        self._echoes: list[_Echo] = []
        self._last: dict[str, int] = {}

    def add(self, sample: UltrasonicSample, now: int) -> Refusal | None:
        """Take one reading.

        inf is a reading: nothing echoed. -inf (REP-117: too close to measure) and anything below
        the least range count as touching the sensor. NaN and numbers up to zero are no readings:
        they are refused, and a sensor that sends only such falls silent.
        """
        reason = self._fault(sample, now)
        if reason is not None:
            return Refusal(sample.stamp, f'ultrasonic/{sample.sensor}', sample.sensor, reason)
        self._last[sample.sensor] = sample.stamp
        points = self._arc(sample)
        # The echoes at hand are in the frame of now; at walking pace the few milliseconds between
        # firing and arrival do not matter, and the age is charged to whoever approaches.
        self._echoes.append(_Echo(sample.stamp, sample.sensor, points))
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
        if sample.stamp <= self._last.get(sample.sensor, 0):
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

    def move(self, motion: Velocity, dt: float) -> None:
        """Carry the echoes along while the robot drives with `motion` for `dt` [s]."""
        if dt <= 0.0 or not self._echoes:
            return
        turn = motion.angular_rad_s * dt
        step = motion.linear_m_s * dt
        moved = Pose2(step * math.cos(turn / 2), step * math.sin(turn / 2), turn).inverse()
        self._echoes = [
            _Echo(echo.stamp, echo.sensor, moved.transform(echo.points)) for echo in self._echoes
        ]

    def forget(self, now: int) -> None:
        """Drop what is older than the hold time, but never the last reading of a sensor."""
        self._echoes = [
            echo
            for echo in self._echoes
            if echo.stamp == self._last[echo.sensor] or seconds(now - echo.stamp) <= self.hold_s
        ]

    def age_s(self, sensor: str, now: int) -> float:
        """Return how long ago a sensor was last heard [s]; inf: never."""
        last = self._last.get(sensor)
        return math.inf if last is None else seconds(now - last)

    def points(self, now: int) -> tuple[Vector, Vector, tuple[str, ...]]:
        """Return where something may be: points (n, 2), ages [s] (n,), sensors (n)."""
        kept = [echo for echo in self._echoes if len(echo.points)]
        if not kept:
            return np.empty((0, 2)), np.empty(0), ()
        ages = [max(seconds(now - echo.stamp), 0.0) for echo in kept]
        count = [len(echo.points) for echo in kept]
        names = tuple(echo.sensor for echo in kept for _ in range(len(echo.points)))
        return (
            np.concatenate([echo.points for echo in kept]),
            np.repeat(ages, count),
            names,
        )

    def reset(self) -> None:
        """Forget everything (time went back)."""
        self._echoes = []
        self._last = {}
