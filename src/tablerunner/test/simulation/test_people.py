"""People on their routes, and what they do about the robot."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Person
from tablerunner.simulation.people import Crowd, Walker

MakePerson = Callable[..., Person]
FAR = Pose2(50.0, 50.0, 0.0)
RADIUS = 0.25


def walk(walker: Walker, seconds: float, robot: Pose2 = FAR) -> None:
    for _ in range(round(seconds * 100)):
        walker.step(0.01, (robot,), RADIUS)


def walker_of(person: Person, seed: int = 0) -> Walker:
    return Walker(person, np.random.default_rng(seed))


def test_walker_goes_along_its_route_at_its_speed(make_person: MakePerson) -> None:
    walker = walker_of(make_person(speed=0.8))
    walk(walker, 2.0)
    state = walker.state
    assert (state.pose.x, state.pose.y) == pytest.approx((3.6, 5.0))
    assert state.pose.heading == pytest.approx(0.0)
    assert state.speed_m_s == 0.8


def test_walker_goes_there_and_back(make_person: MakePerson) -> None:
    """After the last point the way back, after the first the way there again."""
    walker = walker_of(make_person(route=((2.0, 5.0), (4.0, 5.0), (4.0, 6.0))))
    for x, y in ((4.0, 5.0), (4.0, 6.0), (4.0, 5.0), (2.0, 5.0), (4.0, 5.0)):
        walk(walker, math.dist((x, y), (walker.state.pose.x, walker.state.pose.y)))
        assert (walker.state.pose.x, walker.state.pose.y) == pytest.approx((x, y), abs=0.02)


def test_walker_goes_round_a_loop(make_person: MakePerson) -> None:
    corners = ((2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0))
    walker = walker_of(make_person(route=corners, loop=True))
    for x, y in (*corners[1:], *corners):
        walk(walker, 2.0)
        assert (walker.state.pose.x, walker.state.pose.y) == pytest.approx((x, y), abs=0.05)


@pytest.mark.parametrize(
    ('share', 'loop', 'place'),
    [
        (0.0, False, (2.0, 2.0)),
        (0.25, False, (3.0, 2.0)),
        (1.0, False, (4.0, 4.0)),
        (0.75, True, (2.0 + math.sqrt(2) * 0.5, 2.0 + math.sqrt(2) * 0.5)),
    ],
)
def test_walker_begins_at_its_share_of_the_route(
    make_person: MakePerson, share: float, loop: bool, place: tuple[float, float]
) -> None:
    route = ((2.0, 2.0), (4.0, 2.0), (4.0, 4.0))
    if loop:
        share = 1.0 - 1.0 / (4.0 + 2.0 * math.sqrt(2))  # one metre before the end
    state = walker_of(make_person(route=route, loop=loop, start_share=share)).state
    assert (state.pose.x, state.pose.y) == pytest.approx(place)


def test_walker_of_one_point_stands(make_person: MakePerson) -> None:
    walker = walker_of(make_person(route=((3.0, 3.0),)))
    walk(walker, 1.0)
    assert (walker.state.pose.x, walker.state.speed_m_s) == (3.0, 0.0)


def test_walker_pauses_as_often_and_as_long_as_configured(make_person: MakePerson) -> None:
    """Mean time per leg = length / speed + chance x mean pause."""
    person = make_person(
        route=((2.0, 5.0), (3.0, 5.0)), pause_probability=0.5, pause=2.0, speed=1.0
    )
    walker = walker_of(person, seed=5)
    standing = 0
    for _ in range(200_000):
        walker.step(0.01, (FAR,), RADIUS)
        standing += walker.state.speed_m_s == 0.0
    # In 2000 s: a leg takes 1 s and then 0.5 x 2 s on average, so half of the time is pause.
    assert standing / 200_000 == pytest.approx(0.5, abs=0.05)


def test_walker_who_yields_keeps_the_distance(make_person: MakePerson) -> None:
    """Stops with the yield distance left between the bodies, and looks at the robot."""
    walker = walker_of(make_person(yield_distance=0.6, patience=100.0))
    walk(walker, 10.0, robot=Pose2(6.0, 5.0, 0.0))
    gap = 6.0 - walker.state.pose.x - RADIUS - 0.25
    assert gap == pytest.approx(0.6, abs=0.011)
    assert walker.state.speed_m_s == 0.0


def test_walker_who_does_not_yield_stops_only_at_touch(make_person: MakePerson) -> None:
    walker = walker_of(make_person(yield_probability=0.0, patience=100.0))
    walk(walker, 10.0, robot=Pose2(6.0, 5.0, 0.0))
    gap = 6.0 - walker.state.pose.x - RADIUS - 0.25
    assert gap == pytest.approx(0.0, abs=0.011)


def test_walker_decides_anew_at_each_encounter(make_person: MakePerson) -> None:
    """Who yielded to the robot once need not do so the next time."""
    walker = walker_of(make_person(yield_probability=0.5, patience=100.0, speed=0.5), seed=1)
    yielded = []
    for _ in range(40):
        here = walker.state.pose
        ahead = Pose2(here.x + math.cos(here.heading), here.y, 0.0)
        walk(walker, 0.9, ahead)  # 0.5 m between the bodies, 0.45 m to walk
        yielded.append(walker.state.speed_m_s == 0.0)
        walk(walker, 0.1)
    assert 8 < sum(yielded) < 32


def test_walker_goes_on_when_the_robot_has_gone(make_person: MakePerson) -> None:
    walker = walker_of(make_person(patience=100.0))
    walk(walker, 5.0, robot=Pose2(5.0, 5.0, 0.0))
    stopped = walker.state.pose.x
    walk(walker, 1.0)
    assert walker.state.pose.x == pytest.approx(stopped + 1.0, abs=0.02)


def test_walker_minds_no_robot_behind_or_beside(make_person: MakePerson) -> None:
    for robot in (Pose2(1.3, 5.0, 0.0), Pose2(3.0, 5.9, 0.0)):
        walker = walker_of(make_person(yield_distance=0.3))
        walk(walker, 4.0, robot)
        assert walker.state.pose.x == pytest.approx(6.0, abs=0.01)


def test_walker_turns_back_after_waiting(make_person: MakePerson) -> None:
    """Nobody waits for ever: after the patience the same way back, so that no jam lasts."""
    walker = walker_of(make_person(patience=2.0))
    robot = Pose2(6.0, 5.0, 0.0)
    walk(walker, 2.0 + 0.9 + 2.0 - 0.1, robot)
    waiting = walker.state.pose.x
    assert walker.state.speed_m_s == 0.0
    walk(walker, 1.2, robot)
    assert walker.state.pose.x == pytest.approx(waiting - 1.0, abs=0.15)
    assert abs(walker.state.pose.heading) == pytest.approx(math.pi)


@pytest.mark.parametrize('probability', [0.2, 0.9])
def test_walkers_yield_as_often_as_configured(make_person: MakePerson, probability: float) -> None:
    """Drawn once per encounter: over 300 encounters the share is the configured one."""
    person = make_person(yield_probability=probability, patience=100.0)
    robot = Pose2(4.0, 5.0, 0.0)
    yielded = 0
    for seed in range(300):
        walker = walker_of(person, seed)
        walk(walker, 2.0, robot)
        yielded += 4.0 - walker.state.pose.x - 0.5 > 0.3
    assert yielded / 300 == pytest.approx(probability, abs=0.08)


def test_crowd_people_are_independent(make_person: MakePerson) -> None:
    """Taking one person out does not change where another walks."""
    noisy = {'pause_probability': 0.5, 'pause': 1.0}
    first = make_person(name='first', **noisy)
    second = make_person(name='second', **noisy)
    both, one = Crowd((first, second), seed=3), Crowd((second,), seed=3)
    for _ in range(5000):
        both.step(0.01, (FAR,), RADIUS)
        one.step(0.01, (FAR,), RADIUS)
    assert both.states[1] == one.states[0]
    assert both.states[0].pose != both.states[1].pose
