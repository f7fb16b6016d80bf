"""Ways round what was found, and how long to wait for them."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.control import (
    Destination,
    Disc,
    FollowerConfig,
    Mission,
    MissionConfig,
    PurePursuit,
    Situation,
    Surroundings,
    VelocityLimits,
    make_planner,
)
from tablerunner.control.blockades import BlockadeConfig
from tablerunner.control.path import Path
from tablerunner.control.way_finder import WayFinder
from tablerunner.errors import NoWayError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, Wall
from tablerunner.types import NANOSECONDS, nanoseconds

OUTER = Wall(((0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)), 'outer', closed=True)
START, GOAL = Pose2(1.0, 1.0, 0.0), Destination('goal', Pose2(7.0, 1.0, 0.0))
NOW = 10 * NANOSECONDS


class Found(Surroundings):
    """Surroundings with things put where a test wants them."""

    def put(self, x: float, low: float, high: float, seen_to: float = 8.0) -> None:
        """Put a wall of found cells at x from y = low to high; sound has passed up to x = seen_to.

        No more than a thin wall: but for what has not been seen there is nothing behind it.
        """
        for y in np.arange(low, high, 0.05):
            self._evidence[self._map.cell(x, float(y))] = 9.0
            self._firm_s[self._map.cell(x, float(y))] = 3.0
        self._passed[:, : self._map.cell(seen_to, 0.0)[1]] = 9.0
        self._floor = None


def make(*walls: Wall) -> tuple[WayFinder, Found]:
    planner = make_planner(Scenario('room', walls=(OUTER, *walls), start=(1.0, 1.0, 0.0)))
    found = Found(planner.floor, ())
    return WayFinder(planner, found), found


def test_way_leads_round_what_was_found_and_through_it_only_if_need_be() -> None:
    finder, found = make()
    straight = finder.way(START, GOAL, NOW)
    assert straight.length == pytest.approx(6.0, abs=0.05)
    found.put(4.0, 0.0, 2.0)
    round_it = finder.way(START, GOAL, NOW)
    assert round_it.length > 6.3
    assert min(point[1] for point in round_it.points if abs(point[0] - 4.0) < 0.2) > 2.3
    found.put(4.0, 0.0, 5.0)
    assert finder.way(START, GOAL, NOW).length == pytest.approx(6.0, abs=0.05)
    wall = Wall(((4.0, 0.0), (4.0, 5.0)), 'wall')
    closed, _ = make(wall)
    with pytest.raises(PlanningError, match='no way'):
        closed.way(START, GOAL, NOW)


def test_way_keeps_off_the_unseen_back_of_what_was_found() -> None:
    """Where it turns in behind its face, it does so later."""
    turned_in = Destination('goal', Pose2(5.0, 1.0, 0.0))

    def corner_gap(seen_to: float) -> float:
        finder, found = make()
        found.put(4.0, 0.0, 2.0, seen_to)
        points = finder.way(START, turned_in, NOW).resampled(0.02)
        return float(np.hypot(*(points - [4.3, 1.95]).T).min())

    _, all_seen = make()
    all_seen.put(4.0, 0.0, 2.0)
    assert all_seen.floor.unseen is None
    assert corner_gap(8.0) < 0.31  # hardly more than the hull's radius
    assert corner_gap(4.0) > 0.45


def test_short_other_way_is_taken_at_once() -> None:
    finder, found = make()
    path = finder.way(START, GOAL, NOW)
    assert finder.other_way(NOW, START, GOAL, path, path.length) is None
    found.put(2.5, 0.6, 1.4)
    soon = NOW + nanoseconds(0.1)
    assert finder.other_way(soon, START, GOAL, path, path.length) is None  # looks 4 times a s
    other = finder.other_way(NOW + nanoseconds(0.3), START, GOAL, path, path.length)
    assert other is not None
    assert found.gap(other, 0.0, other.length) > 0.28


def test_way_that_just_misses_something_is_left_for_a_roomier_one() -> None:
    finder, found = make()
    path = finder.way(START, GOAL, NOW)
    found.put(2.5, 0.3, 0.76)
    assert 0.2 < found.gap(path, 0.0, 3.0) < 0.3
    other = finder.other_way(NOW, START, GOAL, path, path.length)
    assert other is not None
    assert found.gap(other, 0.0, other.length) > 0.36
    assert other.length < path.length + 0.5
    later = NOW + nanoseconds(2.0)
    assert finder.other_way(later, START, GOAL, other, other.length) is None  # it is as good


def test_way_that_just_misses_something_is_kept_where_there_is_no_roomier_one() -> None:
    finder, found = make(Wall(((2.5, 1.3), (2.5, 5.0)), 'wall'))
    found.put(2.5, 0.0, 0.55)
    path = finder.way(START, GOAL, NOW)
    assert found.gap(path, 0.0, 3.0) < 0.37
    assert finder.other_way(NOW, START, GOAL, path, path.length) is None


def test_long_other_way_is_taken_only_when_the_thing_stays() -> None:
    finder, found = make()
    path = finder.way(START, GOAL, NOW)
    found.put(2.5, 0.0, 4.0)
    taken = [
        step
        for step in range(600)
        if finder.other_way(NOW + step * nanoseconds(0.05), START, GOAL, path, path.length)
    ]
    longer = finder.way(START, GOAL, NOW).length - path.length
    assert longer > 2.0
    assert longer / 0.4 <= taken[0] * 0.05 <= longer / 0.4 + 1.5  # tried every 1.5 s


def test_way_that_begins_by_turning_back_is_waited_for() -> None:
    """The same way at once for one that looks along it, after six seconds for one that turns."""
    waits = []
    for heading in (0.0, -0.9):
        finder, found = make()
        pose = Pose2(START.x, START.y, heading)
        path = finder.way(pose, GOAL, NOW)
        found.put(2.0, 0.5, 1.8)
        waits.append(
            next(
                step * 0.05
                for step in range(600)
                if finder.other_way(NOW + step * nanoseconds(0.05), pose, GOAL, path, path.length)
            )
        )
    assert waits[0] < 0.5
    assert 6.0 <= waits[1] <= 7.6  # tried every 1.5 s


def test_patience_begins_anew_when_the_thing_goes_and_comes() -> None:
    finder, found = make()
    path = finder.way(START, GOAL, NOW)
    for step in range(400):
        if step % 40 == 0:
            found.reset()
            if step % 80 == 0:
                found.put(2.5, 0.0, 4.0)
        stamp = NOW + step * nanoseconds(0.05)
        assert finder.other_way(stamp, START, GOAL, path, path.length) is None


def test_what_lies_behind_or_far_ahead_does_not_matter_yet() -> None:
    finder, found = make()
    path = finder.way(START, GOAL, NOW)
    found.put(6.0, 0.6, 1.4)
    assert finder.other_way(NOW, START, GOAL, path, path.length) is None
    assert finder.other_way(NOW + NANOSECONDS, START, GOAL, path, 0.5) is None


def test_one_that_does_not_move_has_not_moved() -> None:
    finder, _ = make()
    assert finder.has_moved(Pose2(1.0, 1.0))
    assert not finder.has_moved(Pose2(1.2, 1.0))
    assert finder.has_moved(Pose2(1.4, 1.0))
    assert not finder.has_moved(Pose2(1.4, 1.1))


def test_what_was_met_is_kept_off_the_longer_the_oftener() -> None:
    finder, _ = make(Wall(((4.0, 2.5), (4.0, 5.0)), 'wall'))
    thing = Disc(4.0, 1.25, 0.3)
    straight = finder.way(START, GOAL, NOW).length
    finder.meet(thing, NOW, 20.0, 20.0)
    assert finder.way(START, GOAL, NOW).length > straight + 0.05
    assert finder.way(START, GOAL, NOW + nanoseconds(21.0)).length == pytest.approx(straight)
    again = NOW + nanoseconds(30.0)
    finder.meet(thing, again, 20.0, 20.0)
    assert finder.way(START, GOAL, again + nanoseconds(79.0)).length > straight + 0.05
    assert finder.way(START, GOAL, again + nanoseconds(81.0)).length == pytest.approx(straight)


def test_what_stays_in_the_only_door_is_told() -> None:
    door = (Wall(((4.0, 1.6), (4.0, 5.0)), 'wall'), Wall(((4.0, 0.0), (4.0, 0.4)), 'post'))
    finder, _ = make(*door)
    config = BlockadeConfig()
    stamps = NOW + np.linspace(0, nanoseconds(config.span), config.times).astype(int)
    for stamp in map(int, stamps):
        assert finder.lasting_way(START, GOAL, stamp).length == pytest.approx(6.0, abs=0.1)
        finder.meet(Disc(4.0, 1.0, 0.3), stamp, 20.0, 20.0)
    with pytest.raises(NoWayError, match=r'something stands in the way at \(4\.0, 1\.0\)'):
        finder.lasting_way(START, GOAL, stamp)
    with pytest.raises(NoWayError, match='something stands in the way'):
        finder.way(START, GOAL, stamp)
    finder.forget()
    assert finder.lasting_way(START, GOAL, stamp).length == pytest.approx(6.0, abs=0.1)


def test_way_is_free_when_nothing_is_heard_there_whatever_was_met_before() -> None:
    finder, found = make(Wall(((4.0, 2.5), (4.0, 5.0)), 'wall'))
    finder.meet(Disc(4.0, 1.25, 1.2), NOW, 20.0, 9.0)
    with pytest.raises(PlanningError):
        finder.way_around(START, GOAL, NOW)
    assert finder.is_free(NOW, START, GOAL)
    found.put(4.0, 0.0, 2.5)
    later = NOW + nanoseconds(2.0)
    assert not finder.is_free(later, START, GOAL)
    found.reset()
    assert not finder.is_free(later + nanoseconds(0.1), START, GOAL)  # looks now and then only
    assert finder.is_free(later + nanoseconds(2.0), START, GOAL)


def test_what_is_heard_is_kept_off_also_when_marks_leave_no_way() -> None:
    finder, found = make()
    finder.meet(Disc(4.0, 2.5, 3.0), NOW, 20.0, 9.0)
    found.put(4.0, 0.0, 2.0)
    path = finder.way(START, GOAL, NOW)
    assert min(point[1] for point in path.points if abs(point[0] - 4.0) < 0.2) > 2.3


def test_without_surroundings_the_map_is_all_there_is() -> None:
    planner = make_planner(Scenario('room', walls=(OUTER,), start=(1.0, 1.0, 0.0)))
    finder = WayFinder(planner)
    path = finder.way(START, GOAL, NOW)
    assert isinstance(path, Path)
    assert finder.other_way(NOW, START, GOAL, path, path.length) is None


def test_mission_stands_while_somebody_comes_nearer() -> None:
    planner = make_planner(Scenario('room', walls=(OUTER,), start=(1.0, 1.0, 0.0)))

    class Approached(Surroundings):
        """Somebody comes nearer between two stamps."""

        def is_approached(self, stamp: int) -> bool:
            return 2 * NANOSECONDS <= stamp < 4 * NANOSECONDS

    mission = Mission(
        MissionConfig(),
        planner,
        PurePursuit(FollowerConfig(), VelocityLimits()),
        surroundings=Approached(planner.floor, ()),
    )
    mission.start((GOAL,))
    speeds = {}
    for step in range(1, 120):
        stamp = step * nanoseconds(0.05)
        situation = Situation(stamp, START, stamp, 0.05, 0.05)
        speeds[step], _ = mission.step(situation)
    assert speeds[39].linear_m_s == pytest.approx(0.6)
    assert 0.0 < speeds[42].linear_m_s < 0.6  # brakes, and not at once
    assert all(speeds[step].linear_m_s == 0.0 for step in range(60, 80))
    assert speeds[110].linear_m_s > 0.1


@pytest.mark.parametrize(('off', 'arrives'), [(0.2, True), (0.5, False)])
def test_blocked_close_to_a_stop_is_near_enough(off: float, arrives: bool) -> None:
    """Tolerance is 0.12 m; the safety stop lets the robot come no nearer."""
    planner = make_planner(Scenario('room', walls=(OUTER,), start=(1.0, 1.0, 0.0)))
    mission = Mission(MissionConfig(), planner, PurePursuit(FollowerConfig(), VelocityLimits()))
    mission.start((GOAL,))
    pose = Pose2(7.0 - off, 1.0, 0.0)
    for step in range(1, 400):
        stamp = step * nanoseconds(0.05)
        situation = Situation(stamp, pose, stamp, 0.05, 0.05, True, (0.35, 0.0))
        _, status = mission.step(situation)
    assert status.reached == (('goal',) if arrives else ())
