"""The last readings of the five ultrasonic sensors, each with its age.

The sensors fire in turn (Lv, fig. 4), so at any moment the five are of different ages.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.types import Refusal, UltrasonicSample, seconds

SENSORS = ('left', 'left_front', 'front', 'right_front', 'right')
"""The places of the five sensors, Lv's 1 to 5."""

FRAMES = tuple(f'ultrasonic_{name}' for name in SENSORS)
"""Their frames."""

_FUTURE_S = 0.1  # clocks of two machines may differ by this


@dataclass(frozen=True, slots=True)
class Readings:
    """Five distances and their ages, in the order of `SENSORS`.

    Attributes
    ----------
    distances_m : tuple of float
        inf where nothing echoed, 0 where something touches the sensor, NaN where nothing was ever
        heard.
    ages_s : tuple of float
        inf where nothing was ever heard.
    """

    distances_m: tuple[float, float, float, float, float]
    ages_s: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def stale(self, after_s: float) -> tuple[str, ...]:
        """Return the sensors whose reading is older than `after_s`, or missing."""
        return tuple(
            name
            for name, distance, age in zip(SENSORS, self.distances_m, self.ages_s, strict=True)
            if _is_stale(distance, age, after_s)
        )

    def aged(self, closing_m_s: float, reach_m: float, stale_after_s: float) -> list[float]:
        """Return the distances as they may be now [m]: never farther than the truth can be.

        A reading of age t counts as nearer by `closing_m_s` times t, for that far the robot may
        have come since; nothing echoed counts as `reach_m`; a stale or missing reading counts as
        0, as something right before the sensor.
        """
        return [
            0.0
            if _is_stale(distance, age, stale_after_s)
            else max(min(distance, reach_m) - closing_m_s * max(age, 0.0), 0.0)
            for distance, age in zip(self.distances_m, self.ages_s, strict=True)
        ]


def _is_stale(distance: float, age: float, after_s: float) -> bool:
    return not age <= after_s or math.isnan(distance)


class UltrasonicRing:
    """Keeps the last reading of each of the five sensors.

    Parameters
    ----------
    frames : tuple of str
        The sensors' frames, in the order of `SENSORS`.
    """

    def __init__(self, frames: tuple[str, ...] = FRAMES) -> None:
        if len(frames) != len(SENSORS) or len(set(frames)) != len(SENSORS):
            raise ValueError(f'{len(SENSORS)} different sensors are needed, not {frames}')
        self._frames = frames
        self._last: dict[str, tuple[int, float]] = {}

    def reset(self) -> None:
        """Forget everything (time went back)."""
        self._last.clear()

    def add(self, sample: UltrasonicSample, now: int) -> Refusal | None:
        """Take one reading: inf and -inf as REP-117 wants; NaN, zero and less are no readings."""
        reason = self._fault(sample, now)
        if reason is not None:
            return Refusal(sample.stamp, f'ultrasonic/{sample.sensor}', sample.sensor, reason)
        distance = sample.range_m
        if sample.max_range_m > 0.0 and distance >= sample.max_range_m:
            distance = math.inf
        elif distance < sample.min_range_m:
            distance = 0.0
        self._last[sample.sensor] = sample.stamp, max(distance, 0.0)
        return None

    def readings(self, now: int) -> Readings:
        """Return what is known at `now` [ns]."""
        last = [self._last.get(frame) for frame in self._frames]
        a, b, c, d, e = (math.nan if item is None else item[1] for item in last)
        s, t, u, v, w = (
            math.inf if item is None else max(seconds(now - item[0]), 0.0) for item in last
        )
        return Readings((a, b, c, d, e), (s, t, u, v, w))

    def _fault(self, sample: UltrasonicSample, now: int) -> str | None:
        if sample.sensor not in self._frames:
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
        if last is not None and sample.stamp <= last[0]:
            return 'stamp not after the last'
        return None
