"""The fuzzy path controller: Sun's track keeping, and Lv's way round what is not on the map.

Behind the same protocol as `PurePursuit`; besides, it has to be told what the ultrasonic sensors
hear. docs/fuzzy.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.control.contour import ContourConfig, ContourNavigator, Mode
from tablerunner.control.controller import Drive
from tablerunner.control.follower_config import FollowerConfig
from tablerunner.control.fuzzy.reactive import ReactiveConfig, ReactiveController
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.control.fuzzy.track_keeper import TrackConfig, TrackKeeper
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.path import Path
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

_HALF_CONE_RAD = 0.24
_BACK_M, _ON_M = 0.3, 1.0  # progress along the path in one step
_LAST_M = 0.3  # from here on straight to the end


@dataclass(frozen=True)
class DetourConfig(Config):
    """When the path is left for what stands in it, and where it is taken up again."""

    notice: float = parameter(
        0.8, description='Something in the path is heard so near', unit='m', above=0.0
    )
    stand: float = parameter(
        0.35, description='So near the robot waits before it', unit='m', low=0.0
    )
    wait: float = parameter(
        12.0,
        description='So long it must stand there: people walk on, and another path may come',
        unit='s',
        low=0.0,
    )
    shy: float = parameter(
        0.35,
        description='What is nearer to one side than this is turned away from',
        unit='m',
        above=0.0,
    )
    shy_turn: float = parameter(
        1.0,
        description='Turn rate away from what touches a slanting sensor',
        unit='rad/s',
        low=0.0,
    )
    half_width: float = parameter(
        0.3, description='In the path is what is so near its middle', unit='m', above=0.0
    )
    rejoin: float = parameter(
        2.5, description='The way round leads to the path so far ahead', unit='m', above=0.0
    )


class FuzzyController:
    """Keeps to a path, goes round what stands in it by its contour, and rejoins the path.

    Deterministic. Where there is no way round it stands, `blocked_by` says why, and the mission's
    watch over progress has the last word.

    Parameters
    ----------
    limits : VelocityLimits
        Speeds, turn rates and accelerations that are always kept.
    mounts : tuple of Pose2
        Poses of the five ultrasonic sensors in base_link, in the order of `SENSORS`.
    track_m : float
        Distance between the wheels.
    ends : FollowerConfig
        How a path ends: tolerances, braking, turning on the spot.
    """

    def __init__(
        self,
        limits: VelocityLimits,
        mounts: tuple[Pose2, ...],
        track_m: float,
        ends: FollowerConfig | None = None,
        detour: DetourConfig | None = None,
        track: TrackConfig | None = None,
        reactive: ReactiveConfig | None = None,
        contour: ContourConfig | None = None,
    ) -> None:
        self.limits = limits
        self.ends = ends or FollowerConfig()
        self.detour = detour or DetourConfig()
        self._mounts = mounts
        self._keeper = TrackKeeper(track or TrackConfig(), track_m)
        self._navigator = ContourNavigator(
            contour or ContourConfig(),
            ReactiveController(reactive or ReactiveConfig(), limits),
            mounts,
        )
        self._path: Path | None = None
        self._readings: Readings | None = None
        self._heard: Readings | None = None
        self._velocity = Velocity()
        self._explained = False
        self._traces: tuple[Trace, ...] = ()
        self._begin()

    def _begin(self) -> None:
        self._arc = 0.0
        self._at_end = False
        self._turning = False
        self._around = False
        self._seen_s = 0.0
        self._near_m = math.inf  # distance of what stands in the path
        self.blocked_by = ''

    def hear(self, readings: Readings) -> None:
        """Take what the sensors hear now; counts for the next step only."""
        self._readings = readings

    def configure(self, config: FollowerConfig, limits: VelocityLimits) -> None:
        """Use other settings from now on."""
        self.ends = config
        self.limits = limits
        self._navigator.reactive.limits = limits

    def tune(self, track: TrackConfig, reactive: ReactiveConfig) -> None:
        """Use other settings of the rule bases' surroundings from now on."""
        self._keeper.config = track
        self._navigator.reactive.config = reactive

    def explain(self, wanted: bool) -> None:
        """Keep the reasons of each step from now on, or no longer."""
        self._explained = self._navigator.traced = wanted

    @property
    def traces(self) -> tuple[Trace, ...]:
        """What rule bases decided in the last step.

        That of the track while correcting, those of corner and speed on the way round something;
        empty otherwise, and where `explain` did not ask.
        """
        return self._traces

    def follow(self, path: Path) -> None:
        """Take a new path; the velocity carries on from the last one."""
        self._path = path
        self._begin()
        if len(path.points) > 1:
            self._keeper.follow(path)

    def drive(self, velocity: Velocity) -> None:
        """Take note that this is driven instead of what the last step said."""
        self._velocity = velocity

    def halt(self, dt: float) -> Velocity:
        """Return the next velocity of coming to a stand."""
        self._traces = ()
        self._velocity = self.limits.approach(self._velocity, Velocity(), dt)
        return self._velocity

    def step(self, pose: Pose2, dt: float) -> Drive:
        """Return the velocity for a robot at `pose` (base_link in map), `dt` [s] after the last.

        Raises
        ------
        ValueError
            No path was given, or the pose is not finite.
        """
        path = self._path
        if path is None:
            raise ValueError('there is no path to follow')
        if not pose.is_finite:
            raise ValueError('the pose is not finite')
        readings, self._readings = self._readings, None
        self._heard = readings
        self._traces = ()
        end_x, end_y = path.end
        to_end = math.hypot(end_x - pose.x, end_y - pose.y)
        # On the way round the robot may be far ahead on the path already.
        on = self.detour.rejoin + _ON_M if self._around else _ON_M
        self._arc, off = path.project(pose.x, pose.y, self._arc - _BACK_M, self._arc + on)
        left = max(path.length - self._arc, to_end)
        wanted, arrived = self._at_the_end(pose, path, left, to_end)
        if wanted is None:
            wanted = self._on_the_way(pose, path, readings, dt, off, left)
        self._velocity = self.limits.approach(self._velocity, wanted, dt)
        return Drive(self._velocity, left, off, arrived)

    def _at_the_end(
        self, pose: Pose2, path: Path, left: float, to_end: float
    ) -> tuple[Velocity | None, bool]:
        """Return what to do within the position tolerance (None: not there yet), and arrival."""
        tolerance = self.ends.position_tolerance
        # Turning shifts the pose a little; do not start over for it.
        self._at_end = to_end <= (2.0 if self._at_end else 1.0) * tolerance
        self._at_end = self._at_end and left <= 2.0 * tolerance
        if not self._at_end:
            return None, False
        error = 0.0 if path.heading is None else difference(path.heading, pose.heading)
        if abs(error) <= self.ends.heading_tolerance:
            return Velocity(), True
        return self._turn(error), False

    def _on_the_way(
        self,
        pose: Pose2,
        path: Path,
        readings: Readings | None,
        dt: float,
        off: float,
        left: float,
    ) -> Velocity:
        if readings is not None:
            self._near_m = self._in_the_path(pose, path, readings)
            self._seen_s = self._seen_s + dt if self._near_m < math.inf else 0.0
        if not self._around and self._seen_s > self.detour.wait:
            self._around = True
            x, y = path.at(self._arc + self.detour.rejoin)
            self._navigator.go((float(x), float(y)))
        if self._around and readings is not None:
            step = self._navigator.step(readings, pose, dt)
            self._traces = step.traces
            if step.mode is Mode.UNREACHABLE:
                self.blocked_by = step.reason
                return Velocity()
            back = step.mode is Mode.APPROACH and off <= self.detour.half_width
            if not (step.mode is Mode.ARRIVED or (back and not self._seen_s)):
                return step.velocity
            self._around = False
            self._keeper.follow(_rest(path, self._arc))
        elif self._around:
            return Velocity()  # blind
        return self._along(pose, path, left)

    def _along(self, pose: Pose2, path: Path, left: float) -> Velocity:
        """Return the velocity along the free path."""
        ends = self.ends
        braking = math.sqrt(2.0 * ends.approach_deceleration * left)
        speed = min(self.limits.max_speed, max(braking, ends.crawl_speed))
        if self._near_m < math.inf:
            room = max(self._near_m - self.detour.stand, 0.0)
            speed = min(speed, math.sqrt(2.0 * ends.approach_deceleration * room))
        if len(path.points) > 1 and left > _LAST_M:
            step = self._keeper.step(pose, speed, self._explained)
            self._traces = () if step.trace is None else (step.trace,)
            if self._turns(-step.heading_error_rad):
                return self._turn(-step.heading_error_rad)
            return self._shy_of(step.velocity)
        end_x, end_y = path.end
        error = difference(math.atan2(end_y - pose.y, end_x - pose.x), pose.heading)
        if self._turns(error):
            return self._turn(error)
        return self._shy_of(Velocity(speed * math.cos(error), ends.turn_gain * error))

    def _shy_of(self, velocity: Velocity) -> Velocity:
        """Return the velocity turned a little away from what is near on one side.

        The path keeps clear of it, but the pose is not exact. Things on both sides cancel out.
        """
        detour, readings = self.detour, self._heard
        if readings is None or velocity.linear_m_s <= 0.0:
            return velocity
        near = [
            max(1.0 - distance / detour.shy, 0.0) if age <= 0.5 else 0.0
            for distance, age in zip(readings.distances_m, readings.ages_s, strict=True)
        ]
        left, right = max(0.5 * near[0], near[1]), max(0.5 * near[4], near[3])
        turn = velocity.angular_rad_s + detour.shy_turn * (right - left)
        return Velocity(velocity.linear_m_s, turn)

    def _turns(self, error: float) -> bool:
        """Return whether the robot turns before it drives: else it swings out beside the path."""
        limit = self.ends.turn_until if self._turning else self.ends.turn_in_place_above
        self._turning = abs(error) > limit
        return self._turning

    def _turn(self, error: float) -> Velocity:
        rate = min(self.ends.turn_gain * abs(error), self.ends.turn_rate_in_place)
        rate = min(max(rate, self.ends.turn_rate_min), self.limits.max_turn_rate)
        return Velocity(0.0, math.copysign(rate, error))

    def _in_the_path(self, pose: Pose2, path: Path, readings: Readings) -> float:
        """Return how near a sensor hears something ahead in the path [m]; inf: there is nothing.

        It stands in the path when it does so wherever in its cone it is.
        """
        detour, nearest = self.detour, math.inf
        for sensor in (1, 2, 3):
            distance, mount = readings.distances_m[sensor], self._mounts[sensor]
            if not distance <= detour.notice or readings.ages_s[sensor] > 0.5:
                continue
            inside = True
            for bearing in (-_HALF_CONE_RAD, 0.0, _HALF_CONE_RAD):
                at = pose @ mount @ Pose2(0.0, 0.0, bearing) @ Pose2(distance)
                arc, off = path.project(at.x, at.y, self._arc, self._arc + 1.5)
                inside = inside and off <= detour.half_width and arc > self._arc
            if inside:
                nearest = min(nearest, distance)
        return nearest


def _rest(path: Path, arc: float) -> Path:
    """Return what is left of a path from a length along it."""
    return Path(np.concatenate([path.at(arc)[None], path.points[path.arc > arc + 1e-6]]))
