from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control.echoes import EchoMemory, EchoTimes
from tablerunner.geometry.pose import Pose2
from tablerunner.types import UltrasonicSample, Velocity, nanoseconds

MOUNTS = {'front': Pose2(0.2, 0.0, 0.0), 'left': Pose2(0.0, 0.2, math.pi / 2)}
S = nanoseconds


def memory() -> EchoMemory:
    return EchoMemory(MOUNTS, EchoTimes(hold_s=0.6, near_s=3.0, memory_s=6.0, near_m=0.75))


def reading(time_s: float, distance: float, sensor: str = 'front') -> UltrasonicSample:
    return UltrasonicSample(S(time_s), sensor, distance, 0.03, 3.0, 0.48)


def test_echo_lies_on_the_arc_of_its_cone() -> None:
    """All points are at the distance that was read, across the whole opening."""
    echoes = memory()
    assert echoes.add(reading(1.0, 1.0), S(1.0)) is None
    heard = echoes.heard(S(1.0))
    assert heard is not None
    offset = heard.points - [0.2, 0.0]
    assert np.allclose(np.linalg.norm(offset, axis=1), 1.0)
    angles = np.arctan2(offset[:, 1], offset[:, 0])
    assert (angles.min(), angles.max()) == pytest.approx((-0.24, 0.24))


@pytest.mark.parametrize('motion', [Velocity(0.5, 0.0), Velocity(0.0, 0.8), Velocity(0.4, -0.6)])
def test_echo_stays_where_it_is_while_the_robot_moves(motion: Velocity) -> None:
    """Carried along, the points are those of the same things seen from the new pose."""
    echoes = memory()
    echoes.add(reading(1.0, 1.0), S(1.0))
    before = echoes.heard(S(1.0))
    pose, dt = Pose2(), 0.01
    for _ in range(50):
        echoes.move(motion, dt)
        turn = motion.angular_rad_s * dt
        way = motion.linear_m_s * dt
        pose = pose @ Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)
    after = echoes.heard(S(1.5))
    assert before is not None
    assert after is not None
    assert np.allclose(pose.transform(after.points), before.points, atol=1e-9)


@pytest.mark.parametrize('distance', [math.inf, 3.0, 5.0])
def test_no_echo_is_a_reading_of_nothing(distance: float) -> None:
    """Inf, and whatever is at or beyond the greatest range, is a reading: the sensor lives."""
    echoes = memory()
    assert echoes.add(reading(1.0, distance), S(1.0)) is None
    assert echoes.heard(S(1.0)) is None
    assert echoes.age_s('front', S(1.2)) == pytest.approx(0.2)


@pytest.mark.parametrize('distance', [-math.inf, 0.01])
def test_too_near_to_measure_touches_the_sensor(distance: float) -> None:
    echoes = memory()
    assert echoes.add(reading(1.0, distance), S(1.0)) is None
    heard = echoes.heard(S(1.0))
    assert heard is not None
    assert np.allclose(heard.points, [0.2, 0.0])


@pytest.mark.parametrize(
    ('sample', 'words'),
    [
        (reading(1.0, math.nan), 'not a number'),
        (reading(1.0, 0.0), 'not positive'),
        (reading(1.0, -0.5), 'not positive'),
        (reading(0.0, 1.0), 'no stamp'),
        (reading(1.5, 1.0), 'future'),
        (reading(1.0, 1.0, 'rear'), 'unknown sensor'),
        (UltrasonicSample(S(1.0), 'front', 1.0, 0.03, 3.0, math.nan), 'field of view'),
    ],
)
def test_bad_reading_is_refused_and_the_sensor_stays_silent(
    sample: UltrasonicSample, words: str
) -> None:
    echoes = memory()
    refusal = echoes.add(sample, S(1.0))
    assert refusal is not None
    assert words in refusal.reason
    assert echoes.age_s('front', S(1.0)) == math.inf


def test_repeated_stamp_is_refused() -> None:
    echoes = memory()
    assert echoes.add(reading(1.0, 1.0), S(1.0)) is None
    refusal = echoes.add(reading(1.0, 2.0), S(1.0))
    assert refusal is not None
    assert 'not after' in refusal.reason


def test_echo_survives_a_drop_out_and_ends_after_the_hold_time() -> None:
    echoes = memory()
    echoes.add(reading(1.0, 2.0), S(1.0))
    echoes.add(reading(1.15, math.inf), S(1.15))
    echoes.forget(S(1.5))
    assert echoes.heard(S(1.5)) is not None
    echoes.forget(S(1.7))
    assert echoes.heard(S(1.7)) is None


def test_near_echo_heard_twice_is_held_longer_than_one_heard_once() -> None:
    """Sound is mirrored away from slanted things; but a single false echo must not count long."""
    for count, held in ((1, False), (2, True)):
        echoes = memory()
        for number in range(count):
            echoes.add(reading(1.0 + 0.15 * number, 0.3), S(1.5))
        for number in range(3):
            echoes.add(reading(1.5 + 0.15 * number, math.inf), S(2.0))
        echoes.forget(S(2.5))
        assert (echoes.heard(S(2.5)) is not None) is held
        echoes.forget(S(4.5))
        assert echoes.heard(S(4.5)) is None


def test_nothing_is_where_the_hull_has_been_since() -> None:
    """An arc is wider than the thing: what of it the robot has driven over was never there."""
    times = EchoTimes(hold_s=9.0, near_s=9.0, memory_s=9.0, near_m=0.75, hull_m=0.25)
    echoes = EchoMemory(MOUNTS, times)
    echoes.add(reading(1.0, 0.6), S(1.0))
    for step in range(1, 11):
        echoes.move(Velocity(0.6, 0.0), 0.1)
        echoes.add(reading(1.0 + 0.1 * step, math.inf), S(1.0 + 0.1 * step))
        echoes.forget(S(1.0 + 0.1 * step))
        heard = echoes.heard(S(1.0 + 0.1 * step))
        if heard is not None:
            assert np.linalg.norm(heard.points, axis=1).min() >= 0.25 - 0.02 - 1e-9
        if step <= 4:
            assert heard is not None
            assert len(heard.points) == 7  # 0.8 m ahead at first, passed at walking pace
    close = EchoMemory(MOUNTS, times)
    close.add(reading(1.0, 0.01), S(1.0))  # touches the sensor, which sits within the hull
    close.forget(S(1.0))
    assert close.heard(S(1.0)) is not None


def test_corner_that_leaves_the_cone_is_remembered_until_the_robot_is_there() -> None:
    """Heard ahead and to the side, then passed between two cones: it still stands there."""
    echoes, now = EchoMemory(MOUNTS, EchoTimes(0.6, 0.6, 6.0, 0.75)), 1.0
    corner, robot = np.array([1.2, 0.12]), 0.0
    while robot < 0.8:
        seen = corner - [robot + 0.2, 0.0]
        inside = abs(math.atan2(seen[1], seen[0])) <= 0.24
        echoes.add(reading(now, float(np.hypot(*seen)) if inside else math.inf), S(now))
        echoes.move(Velocity(0.3, 0.0), 0.15)
        robot, now = robot + 0.045, now + 0.15
        echoes.forget(S(now))
    heard = echoes.heard(S(now))
    assert heard is not None
    assert np.hypot(*(heard.points - (corner - [robot, 0.0])).T).min() < 0.08
    # What of the arcs the cone has swept since is known to be free.
    front = heard.points - [0.2, 0.0]
    swept = np.abs(np.arctan2(front[:, 1], front[:, 0])) < 0.2
    assert not swept.any()


def approach(speed: float, motion: Velocity, sensor: str = 'front') -> EchoMemory:
    """Read a thing that comes nearer at `speed` by itself while the robot moves on."""
    echoes, distance = memory(), 1.5
    towards = motion.linear_m_s * math.cos(MOUNTS[sensor].heading)
    for number in range(6):
        now = 1.0 + 0.15 * number
        echoes.add(reading(now, distance, sensor), S(now))
        echoes.move(motion, 0.15)
        distance -= (speed + towards) * 0.15
    return echoes


@pytest.mark.parametrize('own', [0.0, 0.3, 0.6])
def test_person_coming_nearer_is_told_from_a_wall(own: float) -> None:
    """Own motion towards a wall is no approach; a person who walks at the robot is one."""
    for speed, nearing in ((0.0, False), (0.8, True)):
        heard = approach(speed, Velocity(own, 0.0)).heard(S(1.8))
        assert heard is not None
        newest = heard.ages_s <= heard.ages_s.min()
        assert heard.nearing[newest].all() == nearing
        assert not heard.nearing[~newest].any()


@pytest.mark.parametrize('own', [0.0, 0.3, 0.6])
def test_pace_of_who_comes_nearer_slowly_is_measured(own: float) -> None:
    """Too slow to be told from a slanted wall for sure, and yet he may meet the robot."""
    for pace in (0.0, 0.2):
        heard = approach(pace, Velocity(own, 0.0)).heard(S(1.8))
        assert heard is not None
        assert not heard.nearing.any()
        newest = heard.ages_s <= heard.ages_s.min()
        assert heard.paces_m_s[newest] == pytest.approx(pace, abs=0.01)
        assert not heard.paces_m_s[~newest].any()


def test_slanted_wall_beside_the_way_is_no_person() -> None:
    """At 30 degrees the wall comes nearer by half the robot's speed."""
    heard = approach(0.3, Velocity(0.6, 0.0), 'left').heard(S(1.8))
    assert heard is not None
    assert not heard.nearing.any()
    assert not heard.paces_m_s.any()
    assert heard.beside.all()


def test_thing_that_appears_counts_as_closing_for_a_second() -> None:
    echoes = memory()
    echoes.add(reading(1.0, math.inf), S(1.0))
    echoes.add(reading(1.15, 1.0), S(1.15))
    for time_s, closing in ((1.2, True), (2.2, False)):
        heard = echoes.heard(S(time_s))
        assert heard is not None
        assert heard.closing.all() == closing


@pytest.mark.parametrize(('motion', 'kept_s'), [(Velocity(), 24.0), (Velocity(0.0, 0.1), 6.0)])
def test_robot_that_stands_remembers_four_times_as_long(motion: Velocity, kept_s: float) -> None:
    """What held it up may be where no cone looks: it must not drive on for having waited."""
    echoes = memory()
    for time_s in (1.0, 1.15):
        echoes.add(reading(time_s, 0.3, 'left'), S(time_s))
    lasted = 0.0
    while lasted < 60.0:
        lasted += 0.1
        echoes.move(motion, 0.1)
        now = 1.15 + lasted
        # It looks elsewhere meanwhile: far off, in front.
        echoes.add(reading(now, 2.5), S(now))
        echoes.forget(S(now))
        heard = echoes.heard(S(now))
        assert heard is not None
        if np.hypot(*(heard.points.T)).min() > 1.0:
            break
        echoes._last['left'] = echoes._last['front']  # the newest of a sensor is always kept
    assert lasted == pytest.approx(kept_s, abs=0.3)
