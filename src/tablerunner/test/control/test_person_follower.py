"""The follower on a floor without errors: distance, limits, losing and finding, giving up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import SafetyConfig, VelocityLimits, sensor_mounts
from tablerunner.control.follow_config import FollowConfig, least_distance
from tablerunner.control.fuzzy.readings import SENSORS, Readings
from tablerunner.control.person_follower import FollowState, PersonFollower
from tablerunner.errors import ConfigError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import RobotGeometry
from tablerunner.types import NANOSECONDS, PersonSample, nanoseconds

MOUNTS = tuple(sensor_mounts(RobotGeometry())[f'ultrasonic_{name}'] for name in SENSORS)
LIMITS = VelocityLimits()
DT = 0.05
FREE = Readings((math.inf,) * 5)


def make(config=None, limits=LIMITS, safety=None):
    follower = PersonFollower(config or FollowConfig(), limits, MOUNTS, safety)
    follower.start(NANOSECONDS)
    return follower


def seen(pose, place, velocity=(0.0, 0.0), std=0.1, stamp=NANOSECONDS):
    """Return a person at a place in the odometry's frame as seen from a pose."""
    ahead = pose.inverse().transform(np.array(place))
    course = np.array([math.cos(pose.heading), math.sin(pose.heading)])
    along = float(course @ velocity)
    across = float(course[0] * velocity[1] - course[1] * velocity[0])
    covariance = np.diag([std**2, std**2, 0.01, 0.01])
    return PersonSample(
        stamp, 'host', (float(ahead[0]), float(ahead[1])), (along, across), covariance
    )


def run(follower, place, duration_s, pose=None, visible=lambda _t: True, readings=None):
    """Let a follower drive behind `place(t)`; return poses and steps."""
    pose = pose or Pose2()
    poses, steps = [pose], []
    for number in range(1, round(duration_s / DT) + 1):
        t = number * DT
        stamp = NANOSECONDS + nanoseconds(t)
        velocity = (np.array(place(t + 1e-3)) - np.array(place(t - 1e-3))) / 2e-3
        person = seen(pose, place(t), velocity, stamp=stamp) if visible(t) else None
        heard = readings(pose) if readings else FREE
        step = follower.step(stamp, DT, pose, person, 'no range', heard)
        turn, way = step.velocity.angular_rad_s * DT, step.velocity.linear_m_s * DT
        pose = pose @ Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)
        poses.append(pose)
        steps.append(step)
    return poses, steps


@pytest.mark.parametrize('speed', [0.3, 0.4, 0.5])
@pytest.mark.parametrize('course', [0.0, 0.8, -1.5, 3.0])
def test_follower_keeps_the_set_distance_behind_a_walking_person(speed, course):
    """Once it has caught up it goes as fast as the person; what is left is under 3 cm."""
    away = np.array([math.cos(course), math.sin(course)])
    poses, steps = run(make(), lambda t: (1.5 + speed * t) * away, 40.0)
    apart = [
        math.dist((pose.x, pose.y), (1.5 + speed * index * DT) * away)
        for index, pose in enumerate(poses)
    ]
    assert apart[-1] == pytest.approx(1.2, abs=0.03)
    assert min(apart) > 1.0
    assert steps[-1].state is FollowState.FOLLOWING
    assert steps[-1].velocity.linear_m_s == pytest.approx(speed, abs=0.02)


def test_follower_comes_to_stand_before_a_person_who_stands():
    poses, steps = run(make(), lambda _t: (3.0, 2.0), 20.0)
    assert math.dist((poses[-1].x, poses[-1].y), (3.0, 2.0)) == pytest.approx(1.2, abs=0.16)
    assert steps[-1].state is FollowState.STANDING
    assert steps[-1].velocity.linear_m_s == 0.0
    assert abs(steps[-1].bearing_rad) < 0.35


def test_follower_who_comes_nearer_makes_it_stand_never_back_up():
    _, steps = run(make(), lambda t: (max(3.0 - 0.5 * t, 0.6), 0.0), 10.0)
    assert min(step.velocity.linear_m_s for step in steps) == 0.0
    assert steps[-1].state is FollowState.STANDING


@pytest.mark.parametrize('seed', range(5))
def test_follower_keeps_speed_turn_and_acceleration_limits(seed):
    """A person who jumps about: whatever is wanted, the limits hold in each step."""
    rng = np.random.default_rng(seed)
    jumps = rng.uniform(-4.0, 4.0, size=(40, 2))
    config = FollowConfig(speed=0.4)
    _, steps = run(
        make(config), lambda t: jumps[int(t / 0.5) % 40], 20.0, visible=lambda t: t % 3.0 < 2.5
    )
    linear = np.array([0.0, *(step.velocity.linear_m_s for step in steps)])
    angular = np.array([0.0, *(step.velocity.angular_rad_s for step in steps)])
    assert linear.max() <= 0.4 + 1e-9
    assert linear.max() > 0.2
    assert linear.min() >= 0.0
    assert np.diff(linear).max() <= LIMITS.max_acceleration * DT + 1e-9
    assert -np.diff(linear).min() <= LIMITS.max_deceleration * DT + 1e-9
    assert np.abs(angular).max() <= LIMITS.max_turn_rate + 1e-9
    assert np.abs(np.diff(angular)).max() <= LIMITS.max_turn_acceleration * DT + 1e-9


def test_follower_lost_stands_looks_round_and_finds_again():
    config = FollowConfig(seek_speed=0.0)
    poses, steps = run(
        make(config), lambda t: (1.5 + 0.3 * t, 0.0), 20.0, visible=lambda t: t < 5.0 or t > 12.0
    )
    lost = [index for index, step in enumerate(steps) if step.state is FollowState.LOST]
    assert steps[lost[0]].reason == 'no range'
    assert (lost[0] + 1) * DT == pytest.approx(5.0, abs=DT)
    assert (lost[-1] + 1) * DT == pytest.approx(12.0, abs=DT)
    late = lost[20:]
    assert all(steps[index].velocity.linear_m_s == 0.0 for index in late)
    turned = [poses[index].heading for index in late]
    assert max(turned) > 0.4
    assert min(turned) < -0.4
    assert steps[-1].state is FollowState.FOLLOWING


def test_follower_lost_seeks_where_the_person_was_last_seen():
    """The last place is 3 m ahead: the robot waits at the set distance from it, not here."""
    poses, steps = run(make(), lambda _t: (3.0, 0.0), 20.0, visible=lambda t: t < 1.0)
    assert poses[-1].x == pytest.approx(1.8, abs=0.16)
    assert all(step.velocity.linear_m_s <= 0.31 for step in steps[40:])
    assert steps[-1].state is FollowState.LOST


def test_follower_gives_up_with_the_reason_and_stays_so():
    config = FollowConfig(give_up_after=5.0)
    _, steps = run(make(config), lambda _t: (2.0, 0.0), 10.0, visible=lambda t: t < 2.0 or t > 8.0)
    ended = next(i for i, step in enumerate(steps) if step.state is FollowState.GIVEN_UP)
    assert (ended + 1) * DT == pytest.approx(7.0, abs=2 * DT)
    assert steps[ended].reason == 'no range for 5 s'
    assert steps[-1].state is FollowState.GIVEN_UP
    assert steps[-1].velocity.linear_m_s == 0.0


def test_follower_that_never_saw_anybody_gives_up():
    _, steps = run(
        make(FollowConfig(give_up_after=3.0)), lambda _t: (2.0, 0.0), 4.0, None, lambda _t: False
    )
    assert steps[-1].state is FollowState.GIVEN_UP


@pytest.mark.parametrize(
    ('place', 'std', 'reason'),
    [((9.0, 0.0), 0.1, 'farther away than 6 m'), ((2.0, 0.0), 2.0, 'too uncertain')],
)
def test_follower_does_not_believe_what_cannot_be_followed(place, std, reason):
    follower = make()
    step = follower.step(2 * NANOSECONDS, DT, Pose2(), seen(Pose2(), place, std=std))
    assert step.state is FollowState.LOST
    assert reason in step.reason


@pytest.mark.parametrize('x', [math.nan, math.inf])
def test_follower_refuses_a_place_that_is_not_finite(x):
    person = PersonSample(NANOSECONDS, 'host', (x, 0.0), (0.0, 0.0), np.eye(4) * 0.01)
    step = make().step(2 * NANOSECONDS, DT, Pose2(), person)
    assert step.state is FollowState.LOST
    assert math.isfinite(step.velocity.linear_m_s)


def test_follower_that_comes_no_nearer_gives_up():
    """A glass door: the person stands in sight, the robot is held."""
    follower = make(FollowConfig(stuck_after=10.0))
    person = (4.0, 0.0)
    for number in range(1, 300):
        stamp = NANOSECONDS + nanoseconds(number * DT)
        step = follower.step(stamp, DT, Pose2(), seen(Pose2(), person), '', FREE, True)
        if step.state is FollowState.GIVEN_UP:
            break
    assert number * DT == pytest.approx(10.0, abs=0.2)
    assert step.reason == 'no way to the person for 10 s'


def test_follower_held_up_looks_around():
    follower = make()
    turns = []
    for number in range(1, 200):
        stamp = NANOSECONDS + nanoseconds(number * DT)
        step = follower.step(stamp, DT, Pose2(), seen(Pose2(), (4.0, 0.0)), '', FREE, True)
        turns.append(step.velocity.angular_rad_s)
    assert max(turns[:50]) == pytest.approx(0.0, abs=1e-9)
    assert max(turns) > 0.4
    assert min(turns) < -0.4


def echoes_of(discs):
    """Return what the sensors of a robot at a pose hear of discs (x, y, radius) in the room."""

    def hear(pose):
        distances = []
        for mount in MOUNTS:
            at, nearest = pose @ mount, math.inf
            for x, y, radius in discs:
                away = math.dist((at.x, at.y), (x, y))
                bearing = abs(difference(math.atan2(y - at.y, x - at.x), at.heading))
                if bearing <= 0.24 + math.asin(min(radius / away, 1.0)):
                    nearest = min(nearest, away - radius)
            distances.append(max(nearest, 0.03))
        return Readings(tuple(distances))

    return hear


def test_follower_takes_the_person_for_no_obstacle():
    """The body is heard at 0.5 m all the time; nothing is gone round."""
    _, steps = run(
        make(),
        lambda t: (1.5 + 0.4 * t, 0.0),
        15.0,
        readings=lambda pose: echoes_of([(pose.x + 1.2, 0.0, 0.25)])(pose),
    )
    assert {step.state for step in steps} == {FollowState.FOLLOWING}
    assert steps[-1].velocity.linear_m_s == pytest.approx(0.4, abs=0.03)


def test_follower_does_not_go_round_a_single_false_echo():
    """It lasts 0.15 s, until its sensor fires again."""
    follower = make()
    states = set()
    for number in range(1, 60):
        heard = Readings((math.inf, math.inf, 0.4, math.inf, math.inf))
        readings = heard if number % 20 < 3 else FREE
        stamp = NANOSECONDS + nanoseconds(number * DT)
        person = seen(Pose2(), (3.0, 0.0))
        states.add(follower.step(stamp, DT, Pose2(), person, '', readings).state)
    assert states == {FollowState.FOLLOWING}


@pytest.mark.parametrize('aside', [-0.15, 0.05, 0.2])
def test_follower_goes_round_what_stands_between(aside):
    """A pillar of 0.2 m radius 2 m ahead: round it without a touch, and to the set distance."""
    poses, steps = run(
        make(), lambda _t: (4.5, 0.0), 60.0, readings=echoes_of([(2.0, aside, 0.2)])
    )
    gap = min(math.dist((pose.x, pose.y), (2.0, aside)) for pose in poses) - 0.2 - 0.25
    assert gap > 0.0
    assert FollowState.ROUND in {step.state for step in steps}
    assert steps[-1].state is FollowState.STANDING
    assert steps[-1].distance_m == pytest.approx(1.2, abs=0.16)


def test_follower_stopped_comes_to_a_stand_and_is_idle():
    follower = make()
    run(follower, lambda _t: (3.0, 0.0), 3.0)
    follower.stop()
    assert not follower.is_active
    _, steps = run(follower, lambda _t: (3.0, 0.0), 2.0)
    assert steps[-1].velocity.linear_m_s == 0.0
    assert steps[-1].state is FollowState.IDLE


def test_follower_is_deterministic():
    first = run(make(), lambda t: (2.0 + 0.3 * t, math.sin(t)), 10.0)[1]
    again = run(make(), lambda t: (2.0 + 0.3 * t, math.sin(t)), 10.0)[1]
    assert first == again


def test_set_distance_at_which_the_safety_stop_would_hold_is_refused():
    safety = SafetyConfig()
    least = least_distance(safety, FollowConfig().person_radius)
    # Hull 0.25, body 0.6, margin 0.1, and 0.06 m/s: 0.018 of delay and 0.002 of braking.
    assert least == pytest.approx(0.97, abs=0.001)
    with pytest.raises(ConfigError, match=r'at least 0\.97 m'):
        make(FollowConfig(distance=0.9))
    make(FollowConfig(distance=0.98))


def test_set_distance_beyond_reach_is_refused():
    with pytest.raises(ConfigError, match='distance'):
        FollowConfig(distance=4.0, reach=4.0)
