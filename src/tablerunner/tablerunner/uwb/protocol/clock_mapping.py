"""From a device's own time to host time, with the drift between both clocks.

What arrives is late by a delay that is never less than some least one, and often more. So arrival
less device time, over device time, has a straight lower edge: its slope is the drift of the
clocks, its height their offset plus the least delay. The edge is the line below all points with
the least sum of distances to them (Moon, Skelly and Towsley 1999, Estimation and removal of clock
skew from network delay measurements): the side of the lower convex hull over their mean time.
Only the point with the least delay of each second is kept.

The least delay itself cannot be seen. It is taken off where it is known, and else stays in.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

from tablerunner.types import NANOSECONDS, nanoseconds

BIN_S = 1.0
WINDOW_S = 120.0
LEAST_BINS = 10
"""So many points are kept even where they are older than the window: slow tags."""

LEAST_SPAN_S = 10.0
"""Over less than this no drift is estimated: it is taken as 0 +- `LIKELY_DRIFT`."""

FEWEST_BINS = 3
"""Until there are more, arrival times are given: a wrong tick could not be told from a drift."""

LIKELY_DRIFT = 5e-5
LARGEST_FIRST_DRIFT = 0.05
LARGEST_DRIFT = 5e-4
"""Beyond this it is no drift but a wrong tick; arrival times are given then. Delays that change
may look like `LARGEST_FIRST_DRIFT` over a few seconds."""

LARGEST_DELAY_S = 5.0
LARGEST_LEAD_S = 0.5
RESTART_COUNT = 3
"""So many times in a row that cannot be, and the device has started again."""


class MappedStamp(NamedTuple):
    """When something was measured."""

    stamp: int  # [ns] of host time; never after its arrival
    deviation_s: float  # standard deviation; NaN for an arrival time, whose delay is not known
    by_device: bool  # False: the arrival time


class ClockMapping:
    """Maps the times of one device; knows it again after a wrap and after a reset.

    Parameters
    ----------
    tick_ns : float
        One tick of the device's counter [ns].
    counter_bits : int
        Width of the counter, which wraps.
    least_delay_s : float
        What the fastest message takes from measurement to arrival, where that is known [s].

    Attributes
    ----------
    restarts : int
        How often the device's time began anew.
    outliers : int
        Times that could not be, and were answered by their arrival.
    """

    def __init__(self, tick_ns: float, counter_bits: int, least_delay_s: float = 0.0) -> None:
        self._tick_s = tick_ns / NANOSECONDS
        self._range = 1 << counter_bits
        self._least_delay_s = least_delay_s
        self.restarts = self.outliers = 0
        self._points: deque[tuple[float, float]] = deque()  # device time, arrival less it [s]
        self._started = False
        self._strange = 0  # times in a row that could not be
        self._usable = False
        self._origin = self._last_arrival = self._last_stamp = 0  # [ns] of host time
        self._ticks = 0
        self._device_s = 0.0  # of the last time, since the origin
        # The edge: height at `middle`, slope; how far the points lie above it on average [s].
        self._height = self._slope = self._middle = self._excess = 0.0
        self._slope_deviation = LIKELY_DRIFT

    @property
    def drift(self) -> float:
        """By what share host time runs faster than the device's; 0 before it is known."""
        return self._slope if self._started else 0.0

    @property
    def drift_deviation(self) -> float:
        """Standard deviation of the drift; infinite before anything came."""
        return self._slope_deviation if self._started else math.inf

    @property
    def usable(self) -> bool:
        """Whether the device's time runs at a rate that a clock can have."""
        return self._started and self._usable

    def add(self, ticks: int, arrival: int) -> MappedStamp:
        """Return when a message with this device time, which arrived at `arrival`, was measured.

        Calls are in the order of arrival. Stamps never go back, except with a restart.
        """
        if not self._started:
            self._start(ticks, arrival)
            self._started = True
        elapsed_s = (arrival - self._last_arrival) / NANOSECONDS
        step = self._step(ticks, elapsed_s)
        now = self._device_s + step * self._tick_s
        late = (arrival - self._origin) / NANOSECONDS - now
        delay = late - self._edge(now)
        if step < 0 or not -LARGEST_LEAD_S <= delay <= LARGEST_DELAY_S:
            self.outliers += 1
            self._strange += 1
            if self._strange < RESTART_COUNT:
                return self._arrived(arrival)
            self.restarts += 1
            self._start(ticks, arrival)
            now = late = 0.0
        self._strange = 0
        self._ticks, self._last_arrival, self._device_s = ticks, arrival, now
        self._take(now, late)
        if not self._usable:
            return self._arrived(arrival)
        # Counted down to whole ticks, a time is early by half a tick on average: if it ever is by
        # none and by a whole one, which shows in how far the points lie above the edge.
        rounding_s = min(self._tick_s / 2.0, self._excess)
        host_s = now + self._edge(now) + rounding_s - self._least_delay_s
        stamp = self._origin + nanoseconds(host_s)
        self._last_stamp = min(max(stamp, self._last_stamp), arrival)
        return MappedStamp(self._last_stamp, self._deviation(now), True)

    def _start(self, ticks: int, arrival: int) -> None:
        """Begin anew with this time as the first."""
        self._ticks, self._last_arrival, self._origin = ticks, arrival, arrival
        self._device_s = 0.0
        self._points.clear()
        self._height = self._slope = self._middle = self._excess = 0.0
        self._slope_deviation = LIKELY_DRIFT
        self._usable = False
        self._strange = self._last_stamp = 0

    def _step(self, ticks: int, elapsed_s: float) -> int:
        """Return the ticks since the last time, with as many wraps as fit the arrivals best."""
        step = (ticks - self._ticks) % self._range
        return step + self._range * round((elapsed_s / self._tick_s - step) / self._range)

    def _edge(self, now: float) -> float:
        return self._height + self._slope * (now - self._middle)

    def _deviation(self, now: float) -> float:
        drifted = self._slope_deviation * (now - self._middle)
        # The edge rests on the least of the points: it is off by less than they scatter above it.
        scatter = self._excess**2 / len(self._points)
        return math.sqrt(self._tick_s**2 / 12.0 + scatter + drifted**2)

    def _arrived(self, arrival: int) -> MappedStamp:
        self._last_stamp = max(arrival, self._last_stamp)
        return MappedStamp(arrival, math.nan, False)

    def _take(self, now: float, late: float) -> None:
        """Keep the point if it is the least of its second; find the edge anew if it changed."""
        points = self._points
        if points and now // BIN_S == points[-1][0] // BIN_S:
            if late >= points[-1][1]:
                return
            points[-1] = (now, late)
            if late >= self._edge(now) and len(points) > 2:
                return
        else:
            points.append((now, late))
            while len(points) > LEAST_BINS and now - points[0][0] > WINDOW_S:
                points.popleft()
        self._fit()

    def _fit(self) -> None:
        points = self._points
        span = points[-1][0] - points[0][0]
        self._middle = sum(x for x, _ in points) / len(points)
        settled = span >= LEAST_SPAN_S and len(points) > FEWEST_BINS
        slope = wide = 0.0
        if len(points) > FEWEST_BINS:
            whole = list(points) if settled else list(points)[:-1]
            left, right = _supporting_side(whole, self._middle)
            wide = right[0] - left[0]
            slope = (right[1] - left[1]) / wide
            self._usable = abs(slope) <= (LARGEST_DRIFT if settled else LARGEST_FIRST_DRIFT)
        self._slope = slope if settled else 0.0
        self._height = min(y - self._slope * (x - self._middle) for x, y in points)
        self._excess = sum(y - self._edge(x) for x, y in points) / len(points)
        self._slope_deviation = LIKELY_DRIFT
        if settled:
            self._slope_deviation = max(self._excess, self._tick_s / 4.0) / (2.0 * wide)


def _supporting_side(
    points: list[tuple[float, float]], middle: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of the side of the lower convex hull that passes under `middle`."""
    hull: list[tuple[float, float]] = []
    for point in points:
        while len(hull) > 1 and _turn(hull[-2], hull[-1], point) <= 0.0:
            hull.pop()
        hull.append(point)
    for left, right in pairwise(hull):
        if right[0] >= middle:
            return left, right
    return hull[0], hull[-1]


def _turn(
    first: tuple[float, float], second: tuple[float, float], third: tuple[float, float]
) -> float:
    return (second[0] - first[0]) * (third[1] - first[1]) - (second[1] - first[1]) * (
        third[0] - first[0]
    )
