"""The safety stop: the last word on every velocity before it reaches the wheels.

It knows no map and no plan: only what was asked for, what the ultrasonic sensors hear, how well
the robot knows where it is, and how old all of that is. docs/safety.md has the rules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from tablerunner.control.braking import largest_speed, stopping_distance
from tablerunner.control.echoes import EchoMemory, EchoTimes
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Refusal, UltrasonicSample, Vector, Velocity, seconds

_LEAST_CURVATURE = 1e-3  # [1/m]
_SLANT = math.sqrt(2.0)  # something beside the robot may close in at up to 45 degrees


class SafetyState(str, Enum):
    """What the safety stop does with the command."""

    CLEAR = 'clear'
    SLOW = 'slow'
    STOP = 'stop'


@dataclass(frozen=True, slots=True)
class Localisation:
    """How well the robot knows where it is.

    ``stamp`` is that of the newest pose (0: none yet); the standard deviations are the largest of
    the position ellipse [m] and of the heading [rad]. ``lost`` is what localisation says itself,
    however certain its pose looks.
    """

    stamp: int = 0
    position_std_m: float = math.inf
    heading_std_rad: float = math.inf
    lost: bool = False


@dataclass(frozen=True, slots=True)
class SafetyDecision:
    """What goes to the wheels, and why.

    Attributes
    ----------
    velocity : Velocity
    state : SafetyState
    reasons : tuple of str
        In words; empty when clear.
    blocked : bool
        Whether something in the way is among the reasons.
    free_way_m : float
        Way ahead on the arc that was asked for; inf: nothing heard.
    stopping_distance_m : float
        What standing takes from the speed that is put out.
    obstacle : tuple of float or None
        The nearest thing in the way, in base_link [m].
    """

    velocity: Velocity
    state: SafetyState
    reasons: tuple[str, ...] = ()
    blocked: bool = False
    free_way_m: float = math.inf
    stopping_distance_m: float = 0.0
    obstacle: tuple[float, float] | None = None


class SafetyStop:
    """Decides, step by step, what of a command may reach the wheels.

    Deterministic: the same inputs in the same order give the same decisions. All stamps are of one
    clock, given by the caller.

    Parameters
    ----------
    config : SafetyConfig
    limits : VelocityLimits
    mounts : dict of str to Pose2
        Pose of every ultrasonic sensor in base_link by frame name; each must be heard.
    """

    def __init__(
        self, config: SafetyConfig, limits: VelocityLimits, mounts: dict[str, Pose2]
    ) -> None:
        self.config = config
        self.limits = limits
        self._echoes = EchoMemory(mounts, _times(config))
        self._now = 0
        self._last = Velocity()
        self._stopped = False
        self._clear_since: int | None = None
        self._reversed_m = 0.0
        self._cautious_m = 0.0
        self._searched_m = 0.0
        self._emergency: str | None = None

    def configure(self, config: SafetyConfig, limits: VelocityLimits) -> None:
        """Use other settings from now on; what was heard stays."""
        self.config = config
        self.limits = limits
        self._echoes.times = _times(config)

    def add_reading(self, sample: UltrasonicSample, now: int) -> Refusal | None:
        """Take an ultrasonic reading; a refused one counts as silence."""
        return self._echoes.add(sample, now)

    def trigger(self, reason: str = 'emergency stop') -> None:
        """Stop at once and stay so until `release`."""
        self._emergency = reason

    def release(self) -> bool:
        """End an emergency stop; return whether there was one."""
        held = self._emergency is not None
        self._emergency = None
        return held

    @property
    def emergency(self) -> str | None:
        """Why the emergency stop holds; None: it does not."""
        return self._emergency

    def reset(self) -> None:
        """Forget readings and times (time went back); an emergency stop stays."""
        self._echoes.reset()
        self._now, self._last, self._stopped = 0, Velocity(), False
        self._clear_since = None
        self._searched_m = 0.0

    def step(
        self,
        now: int,
        command: Velocity | None,
        command_stamp: int,
        localisation: Localisation,
        motion: Velocity | None = None,
        fault: str = '',
    ) -> SafetyDecision:
        """Return the decision of this instant.

        Parameters
        ----------
        now : int
            Stamp of this step [ns].
        command : Velocity or None
            The last command; None: none yet.
        command_stamp : int
            When it came [ns].
        localisation : Localisation
        motion : Velocity or None
            How the robot moves, measured; None: as was last decided.
        fault : str
            A reason to stand still that only the caller can see, e.g. a clock that stands.
        """
        dt = seconds(now - self._now) if self._now else 0.0
        self._now = now
        self._echoes.move(self._last if motion is None else motion, dt)
        self._echoes.forget(now)
        if self._last.linear_m_s < 0:
            self._reversed_m -= self._last.linear_m_s * dt
        elif self._last.linear_m_s > 0:
            self._reversed_m = 0.0
            self._cautious_m -= self._last.linear_m_s * dt
        searching = self._searches(localisation)
        self._searched_m += abs(self._last.linear_m_s) * dt if searching else -self._searched_m
        reasons = self._halts(now, command, command_stamp, localisation)
        if fault:
            reasons.insert(0, fault)
        if reasons or command is None:
            self._last = Velocity()
            self._stopped, self._clear_since = True, None
            return SafetyDecision(Velocity(), SafetyState.STOP, tuple(reasons))
        decision = self._regulate(now, command, localisation, min(max(dt, 0.0), 0.2))
        self._last = decision.velocity
        return decision

    def _halts(
        self,
        now: int,
        command: Velocity | None,
        command_stamp: int,
        localisation: Localisation,
    ) -> list[str]:
        """Return the reasons to stand still whatever is in the way."""
        config, reasons = self.config, []
        if self._emergency is not None:
            reasons.append(self._emergency)
        if command is None or seconds(now - command_stamp) > config.command_timeout:
            reasons.append('no command')
        elif not (math.isfinite(command.linear_m_s) and math.isfinite(command.angular_rad_s)):
            reasons.append('command is not finite')
        reasons.extend(
            f'{sensor} silent'
            for sensor in self._echoes.mounts
            if not self._echoes.age_s(sensor, now) <= config.ultrasonic_timeout
        )
        if config.require_pose:
            if localisation.stamp <= 0:
                reasons.append('no pose')
            elif seconds(now - localisation.stamp) > config.pose_timeout:
                reasons.append('pose too old')
            elif not localisation.position_std_m <= config.position_std_stop:
                reasons.append('position too uncertain')
            if self._searched_m >= config.search_distance:
                lost = 'lost' if localisation.lost else 'heading not known'
                reasons.append(f'{lost}: driven far enough so')
        return reasons

    def _searches(self, localisation: Localisation) -> bool:
        """Return whether the robot drives only to find out where it is or where it heads."""
        known = localisation.heading_std_rad <= self.config.heading_std_slow
        return localisation.lost or not known

    def _regulate(
        self, now: int, command: Velocity, localisation: Localisation, dt: float
    ) -> SafetyDecision:
        config = self.config
        wanted = self.limits.clamp(command)
        reasons: list[str] = []
        top, way, obstacle, blocked = math.inf, math.inf, None, False
        if wanted.linear_m_s > 0:
            top, way, obstacle, sensor = self._allowed(now, wanted)
            if self._hold(now, top):
                top = 0.0
            elif self._cautious_m > 0.0:
                top = min(top, config.restart_speed)
            if top < wanted.linear_m_s:
                blocked = True
                reasons.append(f'obstacle: {sensor}' if sensor else 'starting again after a stop')
        else:
            self._hold(now, math.inf)
        uncertain = config.require_pose and (
            self._searches(localisation)
            or not localisation.position_std_m <= config.position_std_slow
        )
        if uncertain and abs(wanted.linear_m_s) > config.uncertain_speed:
            top = min(top, config.uncertain_speed)
            reasons.append('lost' if localisation.lost else 'pose uncertain')
        if wanted.linear_m_s < 0 and self._reversed_m >= config.reverse_distance:
            top = 0.0
            reasons.append('backed up far enough unseen')
        velocity = self._output(wanted, top, dt)
        state = SafetyState.CLEAR
        if reasons:
            state = SafetyState.STOP if top <= 0.0 else SafetyState.SLOW
        return SafetyDecision(
            velocity,
            state,
            tuple(reasons),
            blocked,
            way,
            stopping_distance(abs(velocity.linear_m_s), config.delay, config.deceleration),
            obstacle,
        )

    def _output(self, wanted: Velocity, top: float, dt: float) -> Velocity:
        """Return `wanted` slowed to `top`; speeding up takes its time, slowing down does not."""
        linear, angular = wanted.linear_m_s, wanted.angular_rad_s
        if abs(linear) > top:
            if top > 0.0:
                angular *= top / abs(linear)
            else:
                near = self.config.turn_rate_near
                angular = min(max(angular, -near), near)
            linear = math.copysign(top, linear)
        last = self._last.linear_m_s
        gain = self.limits.max_acceleration * dt
        from_speed = abs(last) if last * linear > 0 else 0.0
        if abs(linear) > from_speed + gain:
            linear = math.copysign(from_speed + gain, linear)
        return Velocity(linear, angular)

    def _hold(self, now: int, top: float) -> bool:
        """Return whether a stop for something in the way lasts, given the speed allowed now."""
        if top < self.config.stop_speed:
            self._stopped, self._clear_since = True, None
            self._cautious_m = self.config.restart_distance
            return True
        if not self._stopped:
            return False
        if top < self.config.release_speed:
            self._clear_since = None
            return True
        if self._clear_since is None:
            self._clear_since = now
        if seconds(now - self._clear_since) < self.config.clear_time:
            return True
        self._stopped, self._clear_since = False, None
        return False

    def _allowed(
        self, now: int, wanted: Velocity
    ) -> tuple[float, float, tuple[float, float] | None, str]:
        """Return the allowed speed, the free way, and what ends it and who heard it."""
        config = self.config
        heard = self._echoes.heard(now)
        if heard is None:
            return math.inf, math.inf, None, ''
        ways = self._free_ways(heard.points, wanted) - config.margin
        gaps = np.linalg.norm(heard.points, axis=1) - config.footprint_radius
        # Who comes nearer from ahead may step into the way from beside it.
        ahead = heard.nearing & (heard.points[:, 0] > 0.0)
        ways = np.where(ahead, np.minimum(ways, gaps - config.margin), ways)
        # Who walks towards the robot goes on walking, also while the echo grows old.
        approach = np.where(heard.closing, config.approach_speed, 0.0)
        speeds = largest_speed(
            ways - approach * heard.ages_s, config.delay, config.deceleration, approach
        )
        # Who comes nearer, however slowly, may come on: the robot has to stand when he is there.
        coming = (heard.paces_m_s > 0.0) & (heard.points[:, 0] > 0.0)
        if coming.any():
            pace = heard.paces_m_s[coming]
            room = gaps[coming] - config.margin - pace * heard.ages_s[coming]
            met = largest_speed(room, config.delay, config.deceleration, pace)
            speeds[coming] = np.minimum(speeds[coming], met)
        beside = largest_speed(
            gaps * _SLANT - config.side_margin, config.delay, config.deceleration
        )
        # What has just appeared close beside may step into the way at once.
        sudden = heard.closing & (gaps < 0.5 * config.near)
        beside = np.where(sudden, 0.0, beside)
        beside = np.maximum(beside, config.creep_speed)
        alongside = heard.beside & (heard.points[:, 0] > -config.footprint_radius)
        speeds = np.minimum(speeds, np.where(alongside, beside, np.inf))
        tight = (gaps < config.side_margin) & (heard.points[:, 0] > 0.1 * gaps)
        speeds = np.minimum(speeds, np.where(tight, config.creep_speed, np.inf))
        best = int(np.argmin(speeds))
        if not np.isfinite(speeds[best]):
            return math.inf, math.inf, None, ''
        obstacle = (float(heard.points[best, 0]), float(heard.points[best, 1]))
        return float(speeds[best]), float(ways[best]), obstacle, str(heard.sensors[best])

    def _free_ways(self, points: Vector, wanted: Velocity) -> Vector:
        """Return how far the hull can go along the wanted arc before it meets each point [m].

        The hull is a disc grown by the side margin. For a point already inside the grown disc the
        hull itself counts, and only if the robot moves towards it: a wall alongside must neither
        hold a robot that leaves it nor one that just fits between two of them.
        """
        hull = self.config.footprint_radius
        way = self._way(points, wanted, hull + self.config.side_margin)
        gap = np.linalg.norm(points, axis=1)
        close = gap < hull + self.config.side_margin
        if close.any():
            way[close] = self._way(points[close], wanted, np.minimum(hull, gap[close] - 1e-6))
        return np.where(close & (points[:, 0] <= 0.1 * gap), np.inf, way)

    def _way(self, points: Vector, wanted: Velocity, radius: Vector | float) -> Vector:
        curvature = wanted.angular_rad_s / wanted.linear_m_s
        if abs(curvature) >= _LEAST_CURVATURE:
            way = _along_arc(points, radius, curvature)
        else:
            way = _straight(points, radius)
        return np.where(way >= 0.0, way, np.inf)


def _straight(points: Vector, radius: Vector | float) -> Vector:
    """Return how far a disc goes straight on until it meets each point [m]; < 0: behind it."""
    room = radius**2 - points[:, 1] ** 2
    return np.asarray(np.where(room > 0.0, points[:, 0] - np.sqrt(np.maximum(room, 0.0)), np.inf))


def _along_arc(points: Vector, radius: Vector | float, curvature: float) -> Vector:
    """Return how far a disc goes along an arc, at most half a turn, until it meets each point.

    The arc's centre, the point and the disc's centre at the touch make a triangle of which all
    sides are known; its angle at the arc's centre is by how much the touch comes before the point.
    """
    arc = 1.0 / abs(curvature)
    across = arc - points[:, 1] * math.copysign(1.0, curvature)
    away = np.maximum(np.hypot(points[:, 0], across), 1e-9)
    cosine = (arc**2 + away**2 - radius**2) / (2.0 * arc * away)
    before = np.arccos(np.clip(cosine, -1.0, 1.0))
    turned = np.mod(np.arctan2(points[:, 0], across) - before, 2.0 * math.pi)
    met = (np.abs(cosine) <= 1.0) & (turned <= math.pi)
    return np.asarray(np.where(met, turned * arc, np.inf))


def _times(config: SafetyConfig) -> EchoTimes:
    near_m = config.footprint_radius + config.near
    return EchoTimes(
        config.hold_time,
        config.hold_time_near,
        config.memory_time,
        near_m,
        config.footprint_radius,
    )
