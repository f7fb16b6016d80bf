"""Following a person: behind at a set distance, round what stands between, waiting when lost.

Works by where the person is seen from the robot, what the ultrasonic sensors hear, and odometry:
no map, and no pose in it. docs/following.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from tablerunner.control.follow_config import FollowConfig, least_distance
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.look_around import LookAround
from tablerunner.control.person_detour import PersonDetour
from tablerunner.control.person_echoes import in_the_way, without_person
from tablerunner.control.person_trail import PersonTrail
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PersonSample, Velocity, seconds

_WALKS_M_S = 0.1  # slower is standing: noise of the velocity
_THERE_M = 0.03  # so near to the set distance is there
_NEARER_M = 0.2  # having come nearer by less is no progress
_HELD_S = 3.0  # held up for so long, the robot looks around
_UNSEEN_S = 1.5  # and without the person for so long


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
        self._trail = PersonTrail()
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
        self._detour = PersonDetour(self.limits, self._mounts)

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
        self._seen = self._free_stamp = stamp

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
        self._trail.reset()
        self._on_trail = False
        self._detour.reset()
        self._last: tuple[PersonSample, Pose2] | None = None  # where the person was last seen

    def step(
        self,
        stamp: int,
        dt: float,
        pose: Pose2,
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
        pose : Pose2
            base_link in a frame that does not jump (odom), which may drift.
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
            return self._wait(stamp, dt, pose, why, readings, blocked)
        if self._state is FollowState.LOST:
            self._look = LookAround(self.config.look_every)
        self._seen = stamp
        self._reason = ''
        place = _seen_at(pose, person)
        if _deviation(person) <= self.config.trail_std:
            self._trail.add(place)
            self._last = person, pose
        error, walks = self._geometry(person)
        if self._is_stuck(stamp, error, walks):
            self._state = FollowState.GIVEN_UP
            self._reason = f'no way to the person for {self.config.stuck_after:g} s'
            return self._out(Velocity(), dt, person)
        wanted = self._behind(person, error, walks)
        if self._state is not FollowState.STANDING:
            wanted, around = self._drive(pose, place, person, wanted.linear_m_s, dt, readings)
            if around:
                self._state = FollowState.ROUND
        look = self._look_if_held(stamp, blocked and self._state is not FollowState.STANDING)
        return self._out(look or wanted, dt, person)

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
        distance = math.hypot(x, y)
        enough = max(self.config.position_std, self.config.bearing_std * distance)
        if not _deviation(person) <= enough:
            return 'place of the tag is too uncertain'
        if distance > self.config.reach:
            return f'the person is farther away than {self.config.reach:g} m'
        return ''

    def _wait(
        self,
        stamp: int,
        dt: float,
        pose: Pose2,
        why: str,
        readings: Readings | None,
        blocked: bool,
    ) -> FollowStep:
        """Go to where the person was last seen, stand and look around, in the end give up."""
        self._best_m = math.inf
        self._reason = why or 'the person is out of sight'
        limit = self.config.give_up_after
        if seconds(stamp - self._seen) > limit:
            self._state = FollowState.GIVEN_UP
            self._reason = f'{self._reason} for {limit:g} s'
            return self._out(Velocity(), dt, None)
        self._state = FollowState.LOST
        wanted = self._seek(pose, dt, readings)
        if wanted is not None:
            look = self._look_if_held(stamp, blocked)
            return self._out(look or wanted, dt, None)
        look = None
        if seconds(stamp - self._seen) > _UNSEEN_S:
            look = self._look.step(stamp, self._velocity.linear_m_s == 0.0)
        return self._out(look or Velocity(), dt, None)

    def _seek(self, pose: Pose2, dt: float, readings: Readings | None) -> Velocity | None:
        """Return the velocity to where the person was last seen; None: near enough to it."""
        if self._last is None or self.config.seek_speed == 0.0:
            return None
        person, seen_from = self._last
        place = _seen_at(seen_from, person)
        error = math.dist((pose.x, pose.y), place) - self.config.distance
        if error <= self.config.start_margin:
            self._last = None
            return None
        speed = min(self.config.gain * error, self.config.seek_speed, self.limits.max_speed)
        return self._drive(pose, place, None, speed, dt, readings)[0]

    def _look_if_held(self, stamp: int, held: bool) -> Velocity | None:
        """Return what to drive to see past what has held the robot up for a while."""
        if not held:
            self._free_stamp = stamp
        if seconds(stamp - self._free_stamp) <= _HELD_S:
            return None
        return self._look.step(stamp, True)

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
        """Return how fast to go: as fast as the person, and the error away; or where to face."""
        config = self.config
        if self._state is FollowState.STANDING or self._state is FollowState.LOST:
            goes = error > config.start_margin or (error > 0.0 and walks > _WALKS_M_S)
        else:
            goes = error > _THERE_M or (walks > _WALKS_M_S and error > -_THERE_M)
        if not goes:
            self._state = FollowState.STANDING
            bearing = math.atan2(person.position[1], person.position[0])
            turn = config.turn_gain * bearing if abs(bearing) > config.face_within else 0.0
            self._detour.reset()
            return Velocity(0.0, turn)
        self._state = FollowState.FOLLOWING
        speed = min(max(walks, 0.0) + config.gain * error, self.limits.max_speed)
        return Velocity(max(speed, 0.0))

    def _drive(
        self,
        pose: Pose2,
        place: tuple[float, float],
        person: PersonSample | None,
        speed: float,
        dt: float,
        readings: Readings | None,
    ) -> tuple[Velocity, bool]:
        """Return the velocity towards a place, and whether something is gone round.

        Straight on where nothing is heard in the way; otherwise along the way that the person
        walked, until that is straight; and round what is heard there as well, along its contour.
        """
        config = self.config
        others = readings
        if readings is not None and person is not None:
            others = without_person(readings, self._mounts, person, config.person_radius)
        target = _from(pose, place)
        aim = self._trail.aim((pose.x, pose.y), place, config.corner_cut)
        if person is None or self._hears(others, target, surely=False):
            self._on_trail = True
        elif aim == place:
            self._on_trail = False
        goal = aim if self._on_trail else place
        target = _from(pose, goal)
        if others is not None:
            # A crumb may lie right before what is in the way: round it leads to the person.
            blocked = self._hears(others, target)
            around = self._detour.step(pose, dt, place, others, blocked)
            if around is not None:
                return around, True
        bearing = math.atan2(target[1], target[0])
        wanted = Velocity(speed * math.cos(bearing), config.turn_gain * bearing)
        if abs(bearing) > config.turn_in_place_above:
            wanted = Velocity(0.0, wanted.angular_rad_s)
        return wanted, False

    def _hears(
        self, others: Readings | None, target: tuple[float, float], surely: bool = True
    ) -> bool:
        """Return whether something is heard in the straight way to a target in base_link."""
        if others is None:
            return False
        return in_the_way(others, self._mounts, target, self.config.notice, surely)


def _seen_at(pose: Pose2, person: PersonSample) -> tuple[float, float]:
    """Return the place of a person in the frame of `pose`, base_link [m]."""
    x, y = person.position
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return pose.x + cos * x - sin * y, pose.y + sin * x + cos * y


def _from(pose: Pose2, place: tuple[float, float]) -> tuple[float, float]:
    """Return a place as seen from base_link [m]."""
    dx, dy = place[0] - pose.x, place[1] - pose.y
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return cos * dx + sin * dy, cos * dy - sin * dx


def _deviation(person: PersonSample) -> float:
    """Return the largest standard deviation of a place [m]."""
    largest = float(np.linalg.eigvalsh(person.covariance[:2, :2])[-1])
    return math.sqrt(max(largest, 0.0)) if largest == largest else math.inf
