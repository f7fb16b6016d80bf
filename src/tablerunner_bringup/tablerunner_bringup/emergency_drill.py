"""An emergency stop in the middle of a run: asked for, watched, and released again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from tablerunner.control import SafetyConfig, stopping_distance
from tablerunner.types import seconds
from tablerunner_bringup.monitor import Monitor, Movement

DRIVING_M_S = 0.3  # where people walk it may drive no faster than caution.busy_speed
HOLD_S = 3.0
ASK_AGAIN_S = 1.0
REQUEST_S = 0.5
"""What the request may take from here to the safety stop, before the robot's own delay."""


class _Phase(Enum):
    WAITING = 'waiting'
    BRAKING = 'braking'
    HELD = 'held'
    RELEASED = 'released'
    OVER = 'over'


@dataclass(frozen=True)
class DrillReport:
    """How it went; lengths in m, times in s of measurement time, NaN: it did not come to that.

    Attributes
    ----------
    speed_m_s : float
        When the stop was asked for.
    stopped_within_m, stopped_within_s : float
        From then until the robot stood.
    allowed_m : float
        The most by the speed, the delays and the deceleration that can be relied on.
    moved_while_held_m : float
        Until the release.
    drove_on_after_s : float
        From the release until it drove again.
    """

    speed_m_s: float = math.nan
    stopped_within_m: float = math.nan
    stopped_within_s: float = math.nan
    allowed_m: float = math.nan
    moved_while_held_m: float = math.nan
    drove_on_after_s: float = math.nan


class EmergencyDrill:
    """Stops the robot once, at speed on the way to one stop; `step` goes on, never waits.

    Parameters
    ----------
    monitor : Monitor
    stop : str
        On the way there.
    """

    def __init__(self, monitor: Monitor, stop: str) -> None:
        self._monitor = monitor
        self._stop = stop
        self._phase = _Phase.WAITING
        self._at: Movement | None = None
        self._asked_at = 0
        self._safety = SafetyConfig()
        self.report = DrillReport()

    def step(self, feedback: Any) -> str:
        """Go on; return in words what has just happened, or ''."""
        truth = self._monitor.truth
        if truth is None:
            return ''
        at = self._at or truth
        since_s = seconds(truth.stamp - at.stamp)
        moved_m = truth.pose.distance_to(at.pose)
        if self._phase is _Phase.WAITING:
            driving = feedback is not None and feedback.state == 'driving'
            if driving and feedback.stop == self._stop and truth.linear_m_s > DRIVING_M_S:
                return self._begin(truth)
        elif self._phase is _Phase.BRAKING:
            if self._monitor.emergency and truth.stands:
                self._change(
                    _Phase.HELD, truth, stopped_within_m=moved_m, stopped_within_s=since_s
                )
                return f'stands after {moved_m:.2f} m and {since_s:.1f} s; held for {HOLD_S:g} s'
            self._ask(self._monitor.stop_robot, truth.stamp)
        elif self._phase is _Phase.HELD:
            if since_s >= HOLD_S:
                self._change(_Phase.RELEASED, truth, moved_while_held_m=moved_m)
                self._asked_at = 0
                self._ask(self._monitor.release_robot, truth.stamp)
                return f'released; it moved {100 * moved_m:.1f} cm meanwhile'
        elif self._phase is _Phase.RELEASED:
            if not self._monitor.emergency and truth.linear_m_s > DRIVING_M_S / 2.0:
                self._change(_Phase.OVER, truth, drove_on_after_s=since_s)
                return f'drives on {since_s:.1f} s after the release'
            self._ask(self._monitor.release_robot, truth.stamp)
        return ''

    def _begin(self, truth: Movement) -> str:
        speed, safety = truth.linear_m_s, self._safety
        allowed = stopping_distance(speed, safety.delay + REQUEST_S, safety.deceleration)
        self._change(_Phase.BRAKING, truth, speed_m_s=speed, allowed_m=allowed)
        self._ask(self._monitor.stop_robot, truth.stamp)
        return f'emergency stop asked for at {speed:.2f} m/s'

    def _ask(self, service: Any, stamp: int) -> None:
        """Ask; again after a while, for nobody waits for the answer."""
        if not self._asked_at or seconds(stamp - self._asked_at) >= ASK_AGAIN_S:
            self._asked_at = stamp
            service()

    def _change(self, phase: _Phase, truth: Movement, **found: float) -> None:
        self._phase, self._at = phase, truth
        self.report = DrillReport(**{**vars(self.report), **found})
