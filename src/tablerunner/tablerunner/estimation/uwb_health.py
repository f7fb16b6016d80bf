"""Whether UWB carries the pose, or odometry alone does and why (Sun 2.6).

Time is that of odometry: of its newest stamp when something is heard. So a stamp of the wrong
epoch on a range upsets nothing here.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.estimation.ekf import range_variance
from tablerunner.estimation.estimator import EstimatorConfig
from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.motion_comparison import Disagreement, RangeWindow, compare_motion
from tablerunner.estimation.status import Cause
from tablerunner.estimation.timeline import Timeline
from tablerunner.estimation.track import OdometryTrack
from tablerunner.geometry.pose import Pose2
from tablerunner.types import (
    NANOSECONDS,
    Anchor,
    Estimate,
    LosState,
    PoseSample,
    RangeSample,
    nanoseconds,
    seconds,
)
from tablerunner.uwb.positioner import SOURCE as UWB_FIX_SOURCE

_MOST = 4000
"""Events and ranges kept at most, should odometry stand still while ranges pour in."""
_EVERY_S = 0.25
"""Time between two comparisons of motion."""
_MOST_COMPARED = 200
"""Ranges compared at most: of more, every so many."""
_CONFIRMATIONS = 3
"""Comparisons in a row that must find agreement before UWB is taken again."""
_SPAN_NEEDED = 0.6
"""Share of the window that ranges must span before they are compared."""


@dataclass(frozen=True)
class UwbHealthConfig(Config):
    """When the pose counts as carried by odometry alone."""

    silence: float = parameter(
        1.0,
        unit='s',
        description='No measurement, or none accepted, for longer is dead reckoning',
        above=0.0,
        high=60.0,
        dynamic=True,
    )
    window: float = parameter(
        2.0,
        unit='s',
        description='Time over which anchors are counted and motion is compared',
        above=0.0,
        high=20.0,
        dynamic=True,
    )
    disagreement: float = parameter(
        0.4,
        unit='m',
        description=(
            'Displacements by UWB and by odometry over that time that differ by more disagree'
        ),
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    disagreement_deviations: float = parameter(
        4.0,
        description='They must also differ by so many standard deviations',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    dead_reckon: bool = parameter(
        False,
        description=(
            'Whether UWB is not taken while it disagrees with odometry otherwise than by wheels '
            'that slip; else the estimator itself decides which of them to doubt'
        ),
        dynamic=True,
    )


class _Event(NamedTuple):
    heard: int  # newest stamp of odometry then [ns]
    key: str  # anchor; '' for a pose
    accepted: bool | None  # None: taken to be made into a position with others
    blocked: bool


class _Row(NamedTuple):
    stamp: int
    anchor: int
    tag_x: float  # in odom [m]
    tag_y: float
    range_m: float  # less the bias that is known
    std: float


class UwbHealth:
    """Remembers the measurements of a short while and judges them together.

    Parameters
    ----------
    config : UwbHealthConfig
    noise : EstimatorConfig
        For the variance of ranges.
    anchors : tuple of Anchor
    lever_arm : tuple
        Tag in base_link [m].
    """

    def __init__(
        self,
        config: UwbHealthConfig,
        noise: EstimatorConfig,
        anchors: tuple[Anchor, ...],
        lever_arm: Point3,
    ) -> None:
        self._config, self._noise = config, noise
        self._lever_arm = lever_arm
        self._anchors = {anchor.anchor_id: (i, anchor) for i, anchor in enumerate(anchors)}
        self._places = np.array([anchor.position for anchor in anchors]).reshape(-1, 3)
        self._events: deque[_Event] = deque(maxlen=_MOST)
        self.begin(0)

    def configure(self, config: UwbHealthConfig, noise: EstimatorConfig) -> None:
        """Use other settings from now on."""
        self._config, self._noise = config, noise

    def begin(self, stamp: int) -> None:
        """Begin anew at a stamp [ns]: a new start, or odometry from another origin."""
        self._begun = self._accepted = stamp
        self._events.clear()
        self._rows: deque[_Row] = deque(maxlen=_MOST)
        self._compared = stamp
        self._agreed = 0  # comparisons in a row
        self._fault: Cause | None = None  # what the last comparisons found

    # -- what is heard --------------------------------------------------------------------------

    def hear(
        self, sample: RangeSample | PoseSample, accepted: bool | None, track: OdometryTrack
    ) -> None:
        """Take note of a measurement, used or not.

        Parameters
        ----------
        sample : RangeSample or PoseSample
        accepted : bool or None
            Whether it corrected the pose; None: it waits for others to make a position.
        track : OdometryTrack
            Tells the time; before the first odometry there is none, and nothing to judge.
        """
        if not len(track):
            return
        heard = track.newest.stamp
        if isinstance(sample, RangeSample):
            self._events.append(_Event(heard, sample.anchor_id, accepted, _is_blocked(sample)))
        else:
            self._events.append(_Event(heard, '', accepted, False))
        if accepted:
            self._accepted = max(self._accepted, heard)
        oldest = heard - nanoseconds(max(self._config.window, self._config.silence))
        while self._events[0].heard < oldest:
            self._events.popleft()

    def compare(self, sample: RangeSample, track: OdometryTrack, timeline: Timeline) -> None:
        """Take a range beside odometry, and compare both motions when it is time.

        With `dead_reckon`, what UWB gave of late is taken back when both begin to disagree.

        Parameters
        ----------
        sample : RangeSample
            Of one of the anchors.
        track : OdometryTrack
            Must reach back to the range and to the newest estimate.
        timeline : Timeline
            Of the estimate.
        """
        estimate = timeline.newest
        index, anchor = self._anchors[sample.anchor_id]
        odom = track.pose(sample.stamp)
        cos, sin = math.cos(odom.heading), math.sin(odom.heading)
        x, y, _ = self._lever_arm
        tag_x, tag_y = odom.x + cos * x - sin * y, odom.y + sin * x + cos * y
        std = math.sqrt(range_variance(self._noise, sample))
        self._rows.append(
            _Row(sample.stamp, index, tag_x, tag_y, sample.range_m - anchor.bias_m, std)
        )
        now = max(sample.stamp, estimate.stamp)
        if now - self._compared < nanoseconds(_EVERY_S):
            return
        self._compared = now
        map_to_odom = estimate.pose @ track.pose(estimate.stamp).inverse()
        found = self._compare(now, estimate, map_to_odom)
        if found is None or (
            found.length_m < self._config.disagreement
            or found.deviations < self._config.disagreement_deviations
        ):
            self._agreed += 1
            if self._agreed >= _CONFIRMATIONS:
                self._fault = None
            return
        self._agreed = 0
        before = self.withholds
        self._fault = Cause.SLIP if found.slipped_m > 0.0 else Cause.DISAGREE
        if self.withholds and not before:
            timeline.withhold_past(UWB_FIX_SOURCE)

    def _compare(self, now: int, estimate: Estimate, map_to_odom: Pose2) -> Disagreement | None:
        rows, span = self._rows, self._config.window
        while rows[0].stamp < now - nanoseconds(span):
            rows.popleft()
            if not rows:
                return None
        if now - rows[0].stamp < nanoseconds(_SPAN_NEEDED * span):
            return None
        table = np.array(list(rows)[:: len(rows) // _MOST_COMPARED + 1], dtype=np.float64)
        window = RangeWindow(
            times=(table[:, 0] - now) / NANOSECONDS,
            tags=map_to_odom.transform(table[:, 2:4]),
            ranges=table[:, 4],
            stds=table[:, 5],
            anchor=table[:, 1].astype(np.int64),
            anchors=self._places,
            tag_height=self._lever_arm[2],
        )
        heading_std = math.sqrt(max(float(estimate.covariance[2, 2]), 0.0))
        return compare_motion(window, span, heading_std, self._config.disagreement)

    @property
    def withholds(self) -> bool:
        """Whether what UWB gives is only to be judged, not taken."""
        return self._config.dead_reckon and self._fault is Cause.DISAGREE

    # -- what comes of it -----------------------------------------------------------------------

    def unfused_s(self, now: int) -> float:
        """Return the time since a measurement was last accepted [s]."""
        return max(seconds(now - self._accepted), 0.0)

    def cause(self, now: int) -> Cause:
        """Return what carries the pose at the newest stamp of odometry [ns]."""
        fresh = now - nanoseconds(self._config.silence)
        if self._begun > fresh:
            return Cause.FUSED  # too early to say anything else
        events = [event for event in self._events if event.heard >= fresh]
        if not events:
            return Cause.SILENT
        if self._fault is not None and any(event.key for event in events):
            return self._fault  # what ranges told, while there are any
        blocked = all(event.blocked for event in events)
        judged = [event.accepted for event in events if event.accepted is not None]
        if judged and not any(judged):
            return Cause.BLOCKED if blocked else Cause.REFUSED
        used = [
            event
            for event in self._events
            if event.accepted is not False
            and event.heard >= now - nanoseconds(self._config.window)
        ]
        if any(event.accepted and not event.key for event in used):
            return Cause.FUSED  # a position is whole, whatever it was made of
        if all(event.blocked for event in used):
            return Cause.BLOCKED
        return Cause.ONE_ANCHOR if len({event.key for event in used}) == 1 else Cause.FUSED


def _is_blocked(sample: RangeSample) -> bool:
    """Whether a range is judged to have come around an obstacle."""
    return sample.nlos_probability > 0.5 or sample.los is LosState.NLOS
