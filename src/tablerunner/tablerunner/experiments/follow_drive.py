"""A simulated drive behind a person: radio, odometry, locator, follower and safety stop together.

What decides sees only what the sensors say; the truth is kept beside it for judging.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import SafetyConfig, VelocityLimits, limits_within, sensor_mounts
from tablerunner.control.follow_config import FollowConfig
from tablerunner.control.fuzzy.readings import SENSORS, UltrasonicRing
from tablerunner.control.person_follower import FollowState, PersonFollower
from tablerunner.control.safety import Localisation, SafetyStop
from tablerunner.errors import ConfigError
from tablerunner.estimation.person_config import PersonLocatorConfig
from tablerunner.estimation.person_locator import PersonLocator
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.odometry.wheels import WheelsConfig
from tablerunner.scenario import Person, PersonTag, Scenario
from tablerunner.simulation import Contact, PersonState, Simulator
from tablerunner.simulation.tag_radio import TagRadio, tag_place
from tablerunner.types import (
    NANOSECONDS,
    ExchangeSample,
    ImuSample,
    OdometrySample,
    RangeSample,
    UltrasonicSample,
    Velocity,
    WheelSample,
)
from tablerunner.uwb import Ranger, RangerConfig
from tablerunner.uwb.solvers.component_wise import calibrate_bias
from tablerunner.uwb.solvers.registry import solve

Array = NDArray[np.float64]

CONTROL_STEPS = 5
"""Steps of 10 ms between two control steps: 20 Hz."""

CALIBRATION_M = 1.0
CALIBRATION_ROUNDS = 60
"""Before the drive the tag is held at four points at this distance (Bae), so often each."""

_WALKS_M_S = 0.1
_CALIBRATION_NS = 100_000  # between two of its exchanges: all are over when the drive begins
_FAR = PersonState('', Pose2(1e6, 1e6), 0.0, 0.1)


@dataclass(frozen=True)
class Calibration:
    """What the ranges at the calibration points say.

    Attributes
    ----------
    biases : tuple of float
        Mean error of the ranges of each anchor [m].
    direction : tuple of float
        Normalised bias of the direction (Bae 10).
    """

    biases: tuple[float, ...]
    direction: tuple[float, float]


@dataclass(frozen=True, eq=False)
class FollowDrive:
    """One drive, sampled at each control step.

    Attributes
    ----------
    times_s : ndarray, shape (k,)
    robot : ndarray, shape (k, 3)
        True x, y [m], heading [rad] of base_link.
    tag : ndarray, shape (k, 2)
        True place of the tag in map [m].
    located : ndarray, shape (k, 2)
        Where the locator saw it, laid on the true pose of the robot [m]; NaN: not in sight.
    speeds : ndarray, shape (k,)
        True forward speed of the robot [m/s].
    states : tuple of FollowState
    held : ndarray of bool, shape (k,)
        Whether the safety stop held the robot for something in the way.
    contacts : tuple of Contact
    reason : str
        Why it gave up.
    """

    times_s: Array
    robot: Array
    tag: Array
    located: Array
    speeds: Array
    states: tuple[FollowState, ...]
    held: NDArray[np.bool_]
    contacts: tuple[Contact, ...]
    reason: str

    @property
    def distances_m(self) -> Array:
        """True distance from base_link to the tag, shape (k,)."""
        return np.asarray(np.linalg.norm(self.tag - self.robot[:, :2], axis=1))

    @property
    def errors_m(self) -> Array:
        """Distance between where the tag was seen and where it was, shape (k,); NaN: unseen."""
        return np.asarray(np.linalg.norm(self.located - self.tag, axis=1))

    @property
    def in_sight(self) -> NDArray[np.bool_]:
        """Whether the tag was in sight, shape (k,)."""
        return np.asarray(np.isfinite(self.located[:, 0]))

    @property
    def walks(self) -> NDArray[np.bool_]:
        """Whether the person walks, shape (k,)."""
        way = np.linalg.norm(np.gradient(self.tag, axis=0), axis=1)
        return np.asarray(way > _WALKS_M_S * CONTROL_STEPS / 100)

    @property
    def hits(self) -> int:
        """Touches for which the robot is to blame."""
        return sum(contact.robot_at_fault for contact in self.contacts)


@dataclass
class _Log:
    rows: list[tuple[float, ...]] = field(default_factory=list)
    states: list[FollowState] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)


def follow(
    scenario: Scenario,
    seed: int,
    duration_s: float,
    config: FollowConfig | None = None,
    method: str = 'tracker',
    silent_from_s: float = math.inf,
) -> FollowDrive:
    """Follow the person of a scenario who wears a tag.

    Parameters
    ----------
    scenario : Scenario
        With anchors on the robot and one person with a tag.
    seed : int
    duration_s : float
        Ends earlier when the robot has given up and stands.
    config : FollowConfig, optional
    method : str
        Of the locator; each gets what a calibration at four points tells it.
    silent_from_s : float
        From then on the tag says nothing.

    Raises
    ------
    ConfigError
        There are no anchors on the robot, or nobody wears a tag.
    """
    person, tag = wearer(scenario)
    sim = Simulator(scenario, seed)
    robot = scenario.robot
    found = calibrate(sim.tags, sim.drive.pose, scenario.people, person, tag)
    ids = tuple(anchor.id for anchor in robot.anchors)
    positions = tuple(value for anchor in robot.anchors for value in anchor.position)
    plain = method == 'component_wise'
    ranger = Ranger(
        RangerConfig(
            anchor_ids=ids,
            anchor_positions=positions,
            anchor_biases=() if plain else found.biases,
        )
    )
    locator = PersonLocator(
        PersonLocatorConfig(
            tag_id=tag.id,
            tag_height=tag.position[2],
            anchor_ids=ids,
            anchor_positions=positions,
            method=method,
            direction_bias=found.direction if plain else (),
        )
    )
    odometer = Odometer(
        OdometerConfig(wheels=WheelsConfig(wheel_radius=robot.wheel_radius, track=robot.track))
    )
    limits = limits_within(VelocityLimits(), robot.limits)
    mounts = sensor_mounts(robot)
    safety_config = SafetyConfig(footprint_radius=robot.footprint_radius, require_pose=False)
    follower = PersonFollower(
        config or FollowConfig(),
        limits,
        tuple(mounts[f'ultrasonic_{name}'] for name in SENSORS),
        safety_config,
    )
    safety = SafetyStop(safety_config, limits, mounts)
    ring, log, moved, odom = UltrasonicRing(), _Log(), Velocity(), Pose2()
    begin = sim.now_ns
    follower.start(begin)
    command: Velocity | None = None
    blocked, reason = False, ''
    index = scenario.people.index(person)
    for number in range(1, round(duration_s * 100) + 1):
        for sample in sim.step(command):
            if isinstance(sample, ExchangeSample) and sample.tag_id == tag.id:
                ranged = ranger.add(sample)
                if isinstance(ranged, RangeSample) and sim.now_ns < begin + silent_from_s * 1e9:
                    locator.add_range(ranged)
            elif isinstance(sample, ImuSample):
                odometer.add_imu(sample)
            elif isinstance(sample, WheelSample):
                odometry = odometer.add_wheels(sample)
                if isinstance(odometry, OdometrySample):
                    locator.add_odometry(odometry)
                    odom = odometry.pose
                    moved = Velocity(odometry.linear_m_s, odometry.angular_rad_s)
            elif isinstance(sample, UltrasonicSample):
                ring.add(sample, sim.now_ns)
                safety.add_reading(sample, sim.now_ns)
            elif isinstance(sample, Contact):
                log.contacts.append(sample)
        command = None
        if number % CONTROL_STEPS:
            continue
        now, dt = sim.now_ns, CONTROL_STEPS / 100
        sight = locator.sight(now)
        step = follower.step(
            now, dt, odom, sight.person, sight.reason, ring.readings(now), blocked
        )
        decision = safety.step(now, step.velocity, now, Localisation(), moved)
        blocked = decision.blocked and decision.velocity.linear_m_s == 0.0
        command = decision.velocity
        place = (math.nan, math.nan)
        if sight.person is not None:
            place = tuple(sim.drive.pose.transform(np.array(sight.person.position)))
        worn = tag_place(sim.people[index], tag.position)
        pose = sim.drive.pose
        at = ((now - begin) / NANOSECONDS, pose.x, pose.y, pose.heading)
        log.rows.append((*at, *worn[:2], *place, sim.drive.linear_m_s, float(blocked)))
        log.states.append(step.state)
        reason = step.reason
        if step.state is FollowState.GIVEN_UP and step.velocity.linear_m_s == 0.0:
            break
    table = np.array(log.rows)
    return FollowDrive(
        table[:, 0],
        table[:, 1:4],
        table[:, 4:6],
        table[:, 6:8],
        table[:, 8],
        tuple(log.states),
        table[:, 9] > 0.0,
        tuple(log.contacts),
        reason if log.states[-1] is FollowState.GIVEN_UP else '',
    )


def wearer(scenario: Scenario) -> tuple[Person, PersonTag]:
    """Return who of a scenario is to be followed: the first who wears a tag.

    Raises
    ------
    ConfigError
        Nobody does.
    """
    for person in scenario.people:
        if person.tag is not None:
            return person, person.tag
    raise ConfigError('people', scenario.name, 'somebody with a tag')


def calibrate(
    radio: TagRadio, robot: Pose2, people: tuple[Person, ...], person: Person, tag: PersonTag
) -> Calibration:
    """Return what is learned while the person stands round the robot, before the clock starts.

    Exchanges that something blocks are left out.
    """
    ids = [anchor.id for anchor in radio.anchors]
    anchors = np.array([anchor.position for anchor in radio.anchors])
    ranger = Ranger(RangerConfig(anchor_ids=tuple(ids), anchor_positions=tuple(anchors.ravel())))
    places = CALIBRATION_M * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    errors: dict[str, list[float]] = {name: [] for name in ids}
    means, stamp = [], 0
    for place in places:
        ranges = np.full((CALIBRATION_ROUNDS, len(ids)), np.nan)
        stands = [
            _standing_at(robot, place, person, tag) if person is who else _FAR for who in people
        ]
        for turn in range(CALIBRATION_ROUNDS * radio.count):
            stamp += _CALIBRATION_NS
            exchange, truth = radio.exchange(stamp, robot, stands)
            ranged = None if exchange is None else ranger.add(exchange)
            if not isinstance(ranged, RangeSample) or truth.blocked_by:
                continue
            if truth.tag_id == tag.id:
                ranges[turn // radio.count, ids.index(truth.anchor_id)] = ranged.range_m
                errors[truth.anchor_id].append(ranged.range_m - truth.distance_m)
        fix = solve('linear', anchors, ranges, 0.1, tag.position[2])
        means.append(np.nanmean(fix.position, axis=0))
    direction = calibrate_bias(places, np.array(means))
    return Calibration(
        tuple(float(np.mean(errors[name])) for name in ids),
        (float(direction[0]), float(direction[1])),
    )


def _standing_at(robot: Pose2, place: Array, person: Person, tag: PersonTag) -> PersonState:
    """Return the person with the tag held at a place round the robot, the body behind it."""
    course = math.atan2(place[1], place[0])
    turned = course - math.atan2(-tag.position[1], -tag.position[0])
    worn = Pose2(float(place[0]), float(place[1]), turned)
    return PersonState(
        person.name,
        robot @ worn @ Pose2(-tag.position[0], -tag.position[1]),
        0.0,
        person.radius,
    )
