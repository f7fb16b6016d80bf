"""Following a person: behind at a set distance, round what stands between, waiting when lost.

Works in base_link alone: where the person is seen from the robot, what the ultrasonic sensors
hear, and the time. No map, no pose. docs/following.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from tablerunner.control.follow_config import FollowConfig, least_distance
from tablerunner.control.fuzzy.reactive import ReactiveConfig, ReactiveController
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.look_around import LookAround
from tablerunner.control.person_echoes import without_person
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PersonSample, Velocity, seconds

_WALKS_M_S = 0.1  # slower is standing: noise of the velocity
_BESIDE_M = 0.35  # nearer to a side sensor than this is in the way of a turn
_NEARER_M = 0.2  # having come nearer by less is no progress
_HELD_S = 3.0  # held up for so long, the robot looks around


class FollowState(str, Enum):
    """What the follower does."""

    IDLE = 'idle'
    FOLLOWING = 'following'
    ROUND = 'going round something'
    STANDING = 'near enough'
    LOST = 'waiting for the person'
    GIVEN_UP = 'given up'


@dataclass(frozen=True, slots=True)
class FollowStep:
    """One control step.

    Attributes
    ----------
    velocity : Velocity
        What to drive, within the limits.
    state : FollowState
    reason : str
        Why the person is waited for, or was given up; empty otherwise.
    distance_m, bearing_rad : float
        Of the person as seen from base_link; NaN out of sight.
    """

    velocity: Velocity
    state: FollowState
    reason: str = ''
    distance_m: float = math.nan
    bearing_rad: float = math.nan


class PersonFollower:
    """Drives behind a person; deterministic.

    The safety stop keeps the last word on what comes out of here.

    Parameters
    ----------
    config : FollowConfig
    limits : VelocityLimits
        Always kept, accelerations too.
    mounts : tuple of Pose2
        Poses of the five ultrasonic sensors in base_link, in the order of `SENSORS`.
    safety : SafetyConfig, optional
        Of the safety stop that comes after it.

    Raises
    ------
    ConfigError
        At the set distance the safety stop would take the person for an obstacle and hold the
        robot for ever.
    """

    def __init__(
        self,
        config: FollowConfig,
        limits: VelocityLimits,
        mounts: tuple[Pose2, ...],
        safety: SafetyConfig | None = None,
    ) -> None:
        self._mounts = mounts
        self._safety = safety or SafetyConfig()
        self.configure(config, limits)
        self._velocity = Velocity()
        self.stop()

    def configure(self, config: FollowConfig, limits: VelocityLimits) -> None:
        """Use other settings from now on."""
        least = least_distance(self._safety, config.person_radius)
        if config.distance < least:
            raise ConfigError(
                'distance',
                config.distance,
                f'at least {least:.2f} m: nearer the safety stop holds the robot for the person',
            )
        self.config = config
        self.limits = limits.replace(max_speed=min(limits.max_speed, config.speed))
        reactive = ReactiveConfig()
        reactive = reactive.replace(min_speed=min(reactive.min_speed, self.limits.max_speed))
        self._reactive = ReactiveController(reactive, self.limits)

    @property
    def state(self) -> FollowState:
        """What it does."""
        return self._state

    @property
    def is_active(self) -> bool:
        """Whether it follows, or waits for, somebody."""
        return self._state not in (FollowState.IDLE, FollowState.GIVEN_UP)

    def start(self, stamp: int) -> None:
        """Begin to follow at `stamp` [ns]; the person need not be in sight yet."""
        self._begin(FollowState.LOST)
        self._seen = stamp

    def stop(self) -> None:
        """Follow nobody any more; `step` brings the robot to a stand."""
        self._begin(FollowState.IDLE)

    def _begin(self, state: FollowState) -> None:
        self._state = state
        self._reason = ''
        self._seen = 0  # stamp at which the person was last in sight
        self._best_m = math.inf  # least error of the distance since the person last walked
        self._best_stamp = 0
        self._free_stamp = 0  # when the safety stop last let the robot go
        self._look = LookAround(self.config.look_every)

    def step(
        self,
        stamp: int,
        dt: float,
        person: PersonSample | None,
        why: str = '',
        readings: Readings | None = None,
        blocked: bool = False,
    ) -> FollowStep:
        """Return what to do now.

        Parameters
        ----------
        stamp : int
            Of this step [ns].
        dt : float
            Since the last step [s].
        person : PersonSample or None
            Where the person is now, seen from base_link; None: out of sight.
        why : str
            Why out of sight.
        readings : Readings or None
            What the ultrasonic sensors hear; None: not known, then the safety stop alone minds
            what stands in the way.
        blocked : bool
            Whether the safety stop holds the robot for something in the way.
        """
        if not self.is_active:
            return self._out(Velocity(), dt, None)
        if person is not None:
            why = self._doubt(person)
            person = None if why else person
        if person is None:
            return self._wait(stamp, dt, why)
        self._seen = stamp
        self._reason = ''
        error, walks = self._geometry(person)
        if self._is_stuck(stamp, error, walks):
            self._state = FollowState.GIVEN_UP
            self._reason = f'no way to the person for {self.config.stuck_after:g} s'
            return self._out(Velocity(), dt, person)
        if not blocked:
            self._free_stamp = stamp
        wanted = self._behind(person, error, walks)
        if self._state is not FollowState.STANDING and readings is not None:
            wanted = self._round(person, wanted, readings)
        held = seconds(stamp - self._free_stamp) > _HELD_S
        look = self._look.step(stamp, held and self._state is not FollowState.STANDING)
        return self._out(wanted if look is None else look, dt, person)

    def _out(self, wanted: Velocity, dt: float, person: PersonSample | None) -> FollowStep:
        self._velocity = self.limits.approach(self._velocity, wanted, dt)
        if person is None:
            return FollowStep(self._velocity, self._state, self._reason)
        x, y = person.position
        return FollowStep(
            self._velocity, self._state, self._reason, math.hypot(x, y), math.atan2(y, x)
        )

    def _doubt(self, person: PersonSample) -> str:
        """Return why a place is not believed; empty: it is."""
        x, y = person.position
        if not (math.isfinite(x) and math.isfinite(y)):
            return 'place of the tag is not finite'
        deviation = math.sqrt(max(float(np.linalg.eigvalsh(person.covariance[:2, :2])[-1]), 0.0))
        if not deviation <= self.config.position_std:
            return 'place of the tag is too uncertain'
        if math.hypot(x, y) > self.config.reach:
            return f'the person is farther away than {self.config.reach:g} m'
        return ''

    def _wait(self, stamp: int, dt: float, why: str) -> FollowStep:
        """Stand and look around, in the end give up."""
        self._best_m = math.inf
        self._reason = why or 'the person is out of sight'
        limit = self.config.give_up_after
        if seconds(stamp - self._seen) > limit:
            self._state = FollowState.GIVEN_UP
            self._reason = f'{self._reason} for {limit:g} s'
            return self._out(Velocity(), dt, None)
        self._state = FollowState.LOST
        stands = self._velocity.linear_m_s == 0.0
        look = self._look.step(stamp, stands)
        return self._out(look or Velocity(), dt, None)

    def _geometry(self, person: PersonSample) -> tuple[float, float]:
        """Return the error to the set distance [m] and the speed of walking away [m/s]."""
        x, y = person.position
        distance = max(math.hypot(x, y), 1e-6)
        walks = 0.0
        if math.isfinite(float(person.covariance[2, 2])):
            walks = (x * person.velocity[0] + y * person.velocity[1]) / distance
        return distance - self.config.distance, walks

    def _is_stuck(self, stamp: int, error: float, walks: float) -> bool:
        """Whether the robot came no nearer for too long to somebody who does not walk away."""
        near = error <= self.config.start_margin
        if near or walks > _WALKS_M_S or error < self._best_m - _NEARER_M:
            self._best_m, self._best_stamp = error, stamp
            return False
        return seconds(stamp - self._best_stamp) > self.config.stuck_after

    def _behind(self, person: PersonSample, error: float, walks: float) -> Velocity:
        """Return the velocity on a free floor: as fast as the person, and the error away."""
        config = self.config
        bearing = math.atan2(person.position[1], person.position[0])
        leaves = error > 0.0 and walks > _WALKS_M_S
        if self._state is FollowState.STANDING or self._state is FollowState.LOST:
            goes = error > config.start_margin or leaves
        else:
            goes = error > 0.0 or walks > _WALKS_M_S
        if not goes:
            self._state = FollowState.STANDING
            turn = config.turn_gain * bearing if abs(bearing) > config.face_within else 0.0
            return Velocity(0.0, turn)
        self._state = FollowState.FOLLOWING
        turn = config.turn_gain * bearing
        if abs(bearing) > config.turn_in_place_above:
            return Velocity(0.0, turn)
        speed = min(max(walks, 0.0) + config.gain * error, self.limits.max_speed)
        return Velocity(max(speed, 0.0) * math.cos(bearing), turn)

    def _round(self, person: PersonSample, wanted: Velocity, readings: Readings) -> Velocity:
        """Return the velocity round what is heard and is not the person (Lv's controller)."""
        config = self.config
        others = without_person(readings, self._mounts, person, config.person_radius)
        left, *ahead, right = others.distances_m
        # Written so that NaN, a sensor that never spoke, counts as something near.
        free = all(reading >= config.notice for reading in ahead)
        if free and left >= _BESIDE_M and right >= _BESIDE_M:
            return wanted
        self._state = FollowState.ROUND
        step = self._reactive.step(others, Pose2(), person.position)
        # Its speed never beyond that of following: the set distance holds here, too.
        return Velocity(
            min(wanted.linear_m_s, step.velocity.linear_m_s), step.velocity.angular_rad_s
        )
