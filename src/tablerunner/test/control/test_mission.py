from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tablerunner.control import (
    Destination,
    Disc,
    FloorMap,
    FollowerConfig,
    Mission,
    MissionConfig,
    MissionState,
    MissionStatus,
    Planner,
    PurePursuit,
    Situation,
    Tour,
    VelocityLimits,
)
from tablerunner.errors import MissionError, PlanningError
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import polygon_edges
from tablerunner.types import Velocity, nanoseconds

WALLS = polygon_edges(np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]]))
PLANNER = Planner(FloorMap.build(WALLS), 0.25)
HOME = Destination('kitchen', Pose2(1.0, 1.0, 0.0))
TABLE = Destination('table_1', Pose2(6.0, 4.0, 1.5), wait_s=2.0)
SECOND = Destination('table_2', Pose2(2.0, 5.0, 0.0))
CLOSED = polygon_edges(np.array([[5.0, 3.0], [7.5, 3.0], [7.5, 5.5], [5.0, 5.5]]))
DT = 0.05


class World:
    """An ideal robot in an empty room; a person may stand in its way and hold it."""

    def __init__(self, planner: Planner = PLANNER, config: MissionConfig | None = None) -> None:
        controller = PurePursuit(FollowerConfig(), VelocityLimits())
        self.mission = Mission(config or MissionConfig(), planner, controller, HOME)
        self.pose = Pose2(1.0, 1.0, 0.0)
        self.now_s = 1.0
        self.person: Disc | None = None
        self.localised = True
        self.position_std, self.heading_std = 0.05, 0.05
        self.held = False
        self.states: list[MissionState] = []
        self.events: list[str] = []
        self.velocity = Velocity()

    def step(self) -> MissionStatus:
        """Advance by one control step."""
        self.now_s += DT
        now = nanoseconds(self.now_s)
        obstacle = self._ahead()
        situation = Situation(
            now,
            self.pose if self.localised else None,
            now if self.localised else 0,
            self.position_std,
            self.heading_std,
            obstacle is not None,
            obstacle,
            self.held,
        )
        self.velocity, status = self.mission.step(situation)
        linear = 0.0 if obstacle is not None or self.held else self.velocity.linear_m_s
        turn = 0.0 if self.held else self.velocity.angular_rad_s * DT
        course = self.pose.heading + turn / 2
        self.pose = Pose2(
            self.pose.x + linear * DT * math.cos(course),
            self.pose.y + linear * DT * math.sin(course),
            wrap(self.pose.heading + turn),
        )
        self.states.append(status.state)
        self.events.extend(status.events)
        return status

    def _ahead(self) -> tuple[float, float] | None:
        if self.person is None:
            return None
        seen = self.pose.between(Pose2(self.person.x, self.person.y, 0.0))
        gap = math.hypot(seen.x, seen.y) - self.person.radius - 0.25
        if gap > 0.25 or abs(math.atan2(seen.y, seen.x)) > 0.8:
            return None
        share = 1.0 - self.person.radius / math.hypot(seen.x, seen.y)
        return seen.x * share, seen.y * share

    def run(self, limit_s: float = 200.0) -> MissionStatus:
        """Go on until the mission is over."""
        for _ in range(int(limit_s / DT)):
            status = self.step()
            if status.state.is_final:
                return status
        raise AssertionError(f'still {status.state.value} after {limit_s} s: {self.events}')

    def until(self, state: MissionState, limit_s: float = 60.0) -> MissionStatus:
        """Go on until the mission is in a state."""
        for _ in range(int(limit_s / DT)):
            status = self.step()
            if status.state is state:
                return status
        raise AssertionError(f'never {state.value}: {self.events}')


def test_delivery_reaches_its_stops_waits_and_comes_home() -> None:
    world = World()
    world.mission.start((TABLE, SECOND), return_home=True)
    status = world.run()
    assert status.state is MissionState.DONE
    assert status.reached == ('table_1', 'table_2', 'kitchen')
    assert status.missed == ()
    assert status.message == '3 of 3 stops reached'
    assert world.states.count(MissionState.WAITING) == pytest.approx(2.0 / DT, abs=3)
    assert MissionState.RETURNING in world.states
    assert math.hypot(world.pose.x - 1.0, world.pose.y - 1.0) < 0.25
    assert world.pose.heading == pytest.approx(0.0, abs=0.15)


def test_distance_left_falls_to_zero() -> None:
    world = World()
    world.mission.start((TABLE,))
    left = []
    while not (status := world.step()).state.is_final:
        if status.state is MissionState.DRIVING:
            left.append(status.distance_left)
    assert left[0] == pytest.approx(math.dist((1, 1), (6, 4)), rel=0.1)
    assert left[-1] < 0.3
    assert max(np.diff(left)) < 0.1


def test_idle_mission_stands() -> None:
    world = World()
    for _ in range(10):
        assert world.step().state is MissionState.IDLE
        assert world.velocity == Velocity()


def test_second_mission_is_refused_while_busy() -> None:
    world = World()
    world.mission.start((TABLE,))
    world.step()
    with pytest.raises(MissionError, match='busy'):
        world.mission.start((SECOND,))
    world.run()
    world.mission.start((SECOND,))
    assert world.run().reached == ('table_2',)


@pytest.mark.parametrize(
    ('stops', 'words'),
    [
        ((), 'at least one stop'),
        ((Destination('x', Pose2(2.0, 2.0), -1.0),), 'x: the wait'),
        ((Destination('x', Pose2(2.0, 2.0), math.nan),), 'x: the wait'),
    ],
)
def test_mission_without_sense_is_refused(stops: tuple[Destination, ...], words: str) -> None:
    world = World()
    with pytest.raises(MissionError, match=words):
        world.mission.start(stops)
    assert not world.mission.is_busy


@pytest.mark.parametrize(
    ('pose', 'words'),
    [
        (Pose2(20.0, 2.0), 'outside the room'),
        (Pose2(0.1, 2.0), 'from an obstacle'),
        (Pose2(math.nan, 2.0), 'not a finite'),
    ],
)
def test_mission_to_bad_pose_is_refused_by_name(pose: Pose2, words: str) -> None:
    world = World()
    with pytest.raises(PlanningError, match=f'table_9: .*{words}'):
        world.mission.start((TABLE, Destination('table_9', pose)))
    assert not world.mission.is_busy


@pytest.mark.parametrize(
    'state',
    [
        MissionState.PLANNING,
        MissionState.DRIVING,
        MissionState.WAITING,
        MissionState.RETURNING,
        MissionState.BLOCKED,
        MissionState.LOCALISING,
        MissionState.ALIGNING,
        MissionState.HELD,
    ],
)
def test_cancel_in_each_state_stops_and_names_what_is_missed(state: MissionState) -> None:
    world = World()
    world.mission.start((TABLE,), return_home=True)
    prepare(world, state)
    world.mission.cancel()
    status = world.step()
    assert status.state is MissionState.CANCELLED
    names = [name for name, _ in status.missed]
    reached = state in (MissionState.WAITING, MissionState.RETURNING)
    assert names == (['kitchen'] if reached else ['table_1', 'kitchen'])
    assert all(reason == 'cancelled' for _, reason in status.missed)
    for _ in range(30):
        world.step()
    assert world.velocity == Velocity()
    world.localised, world.heading_std, world.held, world.person = True, 0.05, False, None
    world.mission.start((SECOND,))
    assert world.run().state is MissionState.DONE


def test_person_who_goes_away_is_waited_for() -> None:
    """Wait first: nothing is planned around somebody who leaves within a few seconds."""
    world = World()
    world.mission.start((TABLE,))
    world.person = Disc(3.5, 2.5, 0.3)
    world.until(MissionState.BLOCKED)
    world.person = None
    status = world.run()
    assert status.state is MissionState.DONE
    assert not any('around' in event for event in world.events)


def test_person_who_stays_is_driven_around() -> None:
    world = World()
    world.mission.start((TABLE,))
    world.person = Disc(3.5, 2.5, 0.3)
    status = world.run()
    assert status.state is MissionState.DONE
    assert any('a way around' in event for event in world.events)


def test_blocked_robot_looks_around_to_both_sides() -> None:
    """What stands between two cones can only be judged when a sensor looks there."""
    world = World(config=MissionConfig(replan_after=60.0))
    world.mission.start((TABLE,))
    world.person = Disc(3.5, 2.5, 0.3)
    world.until(MissionState.BLOCKED)
    before, headings = world.pose.heading, []
    for _ in range(200):
        world.step()
        headings.append(world.pose.heading - before)
    assert max(headings) > 0.4
    assert min(headings) < -0.4


def test_way_blocked_for_long_is_given_up_and_the_next_stop_served() -> None:
    """In a corridor nobody can be driven around: the stop is missed with its reason."""
    parts = np.array([[[4.0, 0.0], [4.0, 2.5]], [[4.0, 3.4], [4.0, 6.0]]])
    planner = Planner(FloorMap.build(np.concatenate([WALLS, parts])), 0.25)
    config = MissionConfig(give_up_after=20.0)
    world = World(planner, config)
    world.mission.start((TABLE, SECOND), return_home=True)
    world.person = Disc(4.0, 2.95, 0.3)
    status = world.run()
    assert status.state is MissionState.FAILED
    assert status.reached == ('table_2', 'kitchen')
    assert status.missed[0][0] == 'table_1'
    assert 'blocked for 2' in status.missed[0][1]
    assert 'table_1' in status.message


def test_unreachable_stop_is_missed_with_its_reason() -> None:
    planner = Planner(FloorMap.build(np.concatenate([WALLS, CLOSED])), 0.25)
    world = World(planner)
    world.mission.start((TABLE, SECOND))
    status = world.run()
    assert status.reached == ('table_2',)
    assert status.missed[0][0] == 'table_1'
    assert 'no way leads' in status.missed[0][1]


def test_stop_not_reached_in_time_is_missed() -> None:
    world = World(config=MissionConfig(stop_limit=3.0))
    world.mission.start((TABLE,))
    status = world.run()
    assert status.missed == (('table_1', 'not reached within 3 s'),)


def test_tour_ends_in_its_time_whatever_holds_the_robot_up() -> None:
    """One stop may take what the others leave, but not what those after it are kept."""
    world = World(config=MissionConfig(tour_limit=40.0))
    world.held = True
    world.mission.start((TABLE, SECOND, TABLE))
    status = world.run()
    assert [why for _, why in status.missed] == [
        'not reached within 80 s',
        'not reached within 20 s',
        'not reached within 20 s',
    ]
    assert world.now_s - 1.0 == pytest.approx(3 * 40.0, abs=1.0)


def test_each_tour_has_the_whole_of_its_time() -> None:
    world = World(config=MissionConfig(tour_limit=40.0))
    world.held = True
    for _ in range(2):
        world.mission.start((TABLE,))
        assert world.run().missed == (('table_1', 'not reached within 40 s'),)


def test_time_that_one_stop_leaves_is_for_the_others_up_to_what_one_may_take() -> None:
    world = World(config=MissionConfig(tour_limit=40.0, stop_limit=70.0))
    world.mission.start((TABLE, SECOND))
    world.until(MissionState.WAITING)
    way_s = world.mission._drive.taken_s
    assert 5.0 < way_s < 30.0
    world.held = True
    status = world.run()
    assert status.missed[0][1] == f'not reached within {min(80.0 - way_s, 70.0):.0f} s'
    again = World(config=MissionConfig(tour_limit=400.0, stop_limit=70.0))
    again.held = True
    again.mission.start((TABLE,))
    assert again.run().missed[0][1] == 'not reached within 70 s'


def test_unlocalised_robot_waits_and_goes_on_when_it_is_found() -> None:
    world = World()
    world.localised = False
    world.mission.start((TABLE,))
    for _ in range(100):
        assert world.step().state is MissionState.LOCALISING
        assert world.velocity == Velocity()
    world.localised = True
    assert world.run().state is MissionState.DONE


def test_robot_that_is_lost_on_the_way_comes_to_a_stand() -> None:
    world = World()
    world.mission.start((TABLE,))
    for _ in range(60):
        world.step()
    assert world.velocity.linear_m_s > 0.4
    world.localised = False
    for _ in range(30):
        world.step()
    assert world.velocity == Velocity()
    world.localised = True
    assert world.run().state is MissionState.DONE


def test_old_pose_counts_as_not_localised() -> None:
    world = World()
    world.mission.start((TABLE,))
    world.step()
    now = nanoseconds(world.now_s + 5.0)
    old = now - nanoseconds(1.5)
    _, status = world.mission.step(Situation(now, world.pose, old, 0.05, 0.05))
    assert status.state is MissionState.LOCALISING


def test_unknown_heading_is_found_by_driving_gently() -> None:
    """Position known, heading not: after a wait a slow arc, and on when the heading is known."""
    world = World()
    world.heading_std = 1.8
    world.mission.start((TABLE,))
    world.until(MissionState.ALIGNING)
    assert world.now_s - 1.0 >= MissionConfig().align_after - 0.1
    for _ in range(40):
        world.step()
        assert 0.0 < world.velocity.linear_m_s <= MissionConfig().align_speed
    world.heading_std = 0.5  # better, but not good enough to end the search
    assert world.step().state is MissionState.ALIGNING
    world.heading_std = 0.1
    assert world.run().state is MissionState.DONE


def test_search_for_heading_turns_where_something_is_in_the_way() -> None:
    world = World()
    world.heading_std = 1.8
    world.mission.start((TABLE,))
    world.person = Disc(1.6, 1.0, 0.2)
    world.until(MissionState.ALIGNING)
    assert world.velocity.linear_m_s == 0.0
    assert world.velocity.angular_rad_s > 0.0


def test_mission_ends_when_the_robot_is_never_localised() -> None:
    world = World(config=MissionConfig(localise_limit=5.0))
    world.localised = False
    world.mission.start((TABLE,), return_home=True)
    status = world.run()
    assert status.state is MissionState.FAILED
    assert [name for name, _ in status.missed] == ['table_1', 'kitchen']
    assert 'not localised for 5 s' in status.message


def test_emergency_stop_is_no_blocked_way() -> None:
    """Held for a minute the mission neither plans around anything nor gives up."""
    world = World()
    world.mission.start((TABLE,))
    for _ in range(40):
        world.step()
    world.held = True
    for _ in range(1200):
        assert world.step().state is MissionState.HELD
    world.held = False
    assert world.run().state is MissionState.DONE


def test_robot_pushed_off_its_path_plans_anew() -> None:
    world = World()
    world.mission.start((TABLE,))
    for _ in range(60):
        world.step()
    world.pose = Pose2(1.0, 5.0, 0.0)
    assert world.run().state is MissionState.DONE
    assert any('off the path' in event for event in world.events)


def test_mission_is_deterministic() -> None:
    """The same inputs in the same order: the same velocities, bit for bit."""
    runs = []
    for _ in range(2):
        world = World()
        world.mission.start((TABLE, SECOND), return_home=True)
        velocities = []
        while not world.step().state.is_final:
            velocities.append(world.velocity)
        runs.append(velocities)
    assert runs[0] == runs[1]


CONFIRMED = Destination('table_1', Pose2(6.0, 4.0, 1.5), confirm_s=10.0)


def test_hand_over_ends_when_somebody_confirms() -> None:
    world = World()
    world.mission.start((CONFIRMED, SECOND))
    world.until(MissionState.HANDING_OVER)
    for _ in range(40):
        assert world.step().state is MissionState.HANDING_OVER
        assert world.velocity == Velocity()
    assert world.mission.confirm() == 'table_1'
    status = world.run()
    assert status.state is MissionState.DONE
    assert status.unconfirmed == ()
    assert world.states.count(MissionState.HANDING_OVER) == pytest.approx(41, abs=2)


def test_hand_over_that_nobody_confirms_ends_in_time_and_is_told() -> None:
    """The next stop is served all the same; the delivery as a whole is no success."""
    world = World()
    world.mission.start((CONFIRMED, SECOND))
    status = world.run()
    assert status.reached == ('table_1', 'table_2')
    assert status.unconfirmed == ('table_1',)
    assert status.missed == ()
    assert status.state is MissionState.FAILED
    assert status.message == '2 of 2 stops reached; not confirmed: table_1'
    assert world.states.count(MissionState.HANDING_OVER) == pytest.approx(10.0 / DT, abs=3)


def test_confirmation_does_not_shorten_the_wait() -> None:
    """Who asks for two seconds at least gets them, however soon somebody confirms."""
    world = World()
    world.mission.start((dataclasses.replace(CONFIRMED, wait_s=2.0),))
    world.until(MissionState.HANDING_OVER)
    world.mission.confirm()
    assert world.run().state is MissionState.DONE
    assert world.states.count(MissionState.WAITING) == pytest.approx(2.0 / DT, abs=3)


def test_confirmation_without_hand_over_is_refused() -> None:
    world = World()
    with pytest.raises(MissionError, match='nothing to confirm'):
        world.mission.confirm()
    world.mission.start((TABLE,))
    world.until(MissionState.DRIVING)
    with pytest.raises(MissionError, match='nothing to confirm'):
        world.mission.confirm()
    world.until(MissionState.WAITING)
    with pytest.raises(MissionError, match='nothing to confirm'):
        world.mission.confirm()


def prepare(world: World, state: MissionState) -> None:
    """Bring a mission into a state."""
    if state is MissionState.LOCALISING:
        world.localised = False
    elif state is MissionState.ALIGNING:
        world.heading_std = 2.0
    elif state is MissionState.HELD:
        world.held = True
    elif state is MissionState.BLOCKED:
        world.person = Disc(3.5, 2.5, 0.3)
    if state is not MissionState.PLANNING:
        world.until(state)


UNDER_WAY = [state for state in MissionState if not (state.is_final or state.value == 'paused')]


@pytest.mark.parametrize('state', UNDER_WAY)
def test_pause_in_each_state_stands_and_resume_goes_on(state: MissionState) -> None:
    """However long the pause: no time limit runs, and the tour is completed."""
    world = World(config=MissionConfig(stop_limit=60.0, localise_limit=20.0))
    stop = CONFIRMED if state is MissionState.HANDING_OVER else TABLE
    world.mission.start((stop,), return_home=True)
    prepare(world, state)
    world.mission.pause()
    with pytest.raises(MissionError, match='paused already'):
        world.mission.pause()
    for count in range(2400):
        assert world.step().state is MissionState.PAUSED
        assert count < 20 or world.velocity == Velocity()
    world.localised, world.heading_std, world.held, world.person = True, 0.05, False, None
    world.mission.resume()
    with pytest.raises(MissionError, match='not paused'):
        world.mission.resume()
    if state is MissionState.HANDING_OVER:
        world.mission.confirm()
    status = world.run()
    assert status.state is MissionState.DONE, world.events
    assert status.reached == ('table_1', 'kitchen')


@pytest.mark.parametrize('state', UNDER_WAY)
def test_cancel_of_a_paused_mission_ends_it(state: MissionState) -> None:
    world = World()
    stop = CONFIRMED if state is MissionState.HANDING_OVER else TABLE
    world.mission.start((stop,), return_home=True)
    prepare(world, state)
    world.mission.pause()
    world.step()
    world.mission.cancel()
    status = world.step()
    assert status.state is MissionState.CANCELLED
    assert status.missed[-1] == ('kitchen', 'cancelled')
    assert len(status.reached) + len(status.missed) == 2
    assert status.unconfirmed == (('table_1',) if state is MissionState.HANDING_OVER else ())


def test_robot_carried_away_in_a_pause_plans_anew() -> None:
    world = World()
    world.mission.start((TABLE,))
    world.until(MissionState.DRIVING)
    world.mission.pause()
    world.step()
    world.pose = Pose2(2.0, 5.0, 3.0)
    world.mission.resume()
    assert world.run().state is MissionState.DONE
    assert sum(event.endswith('m to table_1') for event in world.events) == 2
    assert not any('off the path' in event for event in world.events)


def test_pause_and_resume_of_nothing_are_refused() -> None:
    world = World()
    with pytest.raises(MissionError, match='nothing to pause'):
        world.mission.pause()
    with pytest.raises(MissionError, match='nothing to resume'):
        world.mission.resume()


@pytest.mark.parametrize('state', UNDER_WAY)
def test_skip_in_each_state_goes_on_with_the_next_stop(state: MissionState) -> None:
    world = World()
    stop = CONFIRMED if state is MissionState.HANDING_OVER else TABLE
    world.mission.start((stop, SECOND), return_home=True)
    prepare(world, state)
    if state is MissionState.RETURNING:
        with pytest.raises(MissionError, match='on its way home'):
            world.mission.skip()
        return
    assert world.mission.skip() == 'table_1'
    world.localised, world.heading_std, world.held, world.person = True, 0.05, False, None
    status = world.run()
    assert status.reached[-2:] == ('table_2', 'kitchen')
    stood = state in (MissionState.WAITING, MissionState.HANDING_OVER)
    assert status.missed == (() if stood else (('table_1', 'skipped on request'),))
    assert status.unconfirmed == (('table_1',) if state is MissionState.HANDING_OVER else ())


def test_skip_of_the_last_stop_while_paused_ends_the_mission() -> None:
    world = World()
    world.mission.start((TABLE,))
    world.until(MissionState.DRIVING)
    world.mission.pause()
    world.mission.skip()
    assert world.step().state is MissionState.FAILED
    with pytest.raises(MissionError, match='nothing to skip'):
        world.mission.skip()


def test_tour_is_taken_up_where_it_was_left() -> None:
    """What became of the stops before stands in the result."""
    world = World()
    done = Tour((TABLE, SECOND), HOME, 1, missed=(('table_1', 'way blocked for 90 s'),))
    world.mission.take(done)
    status = world.run()
    assert status.reached == ('table_2', 'kitchen')
    assert status.missed == (('table_1', 'way blocked for 90 s'),)


@pytest.mark.parametrize('confirm', [-1.0, math.nan, math.inf])
def test_time_to_confirm_must_be_one(confirm: float) -> None:
    world = World()
    with pytest.raises(MissionError, match='x: the time to confirm'):
        world.mission.start((Destination('x', Pose2(2.0, 2.0), confirm_s=confirm),))


def test_robot_in_an_aisle_makes_way_for_whom_it_keeps_from_passing() -> None:
    """Two who wait for each other would wait for ever: it leaves the aisle, then comes again."""
    aisle = np.array([[[3.0, 0.5], [8.0, 0.5]], [[3.0, 1.5], [8.0, 1.5]]])
    world = World(Planner(FloorMap.build(np.concatenate([WALLS, aisle])), 0.25))
    world.person = Disc(5.5, 1.0, 0.25)
    world.mission.start((Destination('end', Pose2(7.0, 1.0, 0.0)),))
    while world.now_s < 60.0 and not any('making way' in event for event in world.events):
        world.step()
    assert any('making way' in event for event in world.events)
    assert world.pose.x > 4.0  # it had come near
    until = world.now_s + 20.0
    nearest_x = world.pose.x
    while world.now_s < until:
        world.step()
        nearest_x = min(nearest_x, world.pose.x)
    assert nearest_x < 3.2
    world.person = None
    while world.mission.is_busy and world.now_s < 200.0:
        status = world.step()
    assert status.reached == ('end',)


def test_robot_that_made_way_faces_the_place_and_goes_when_it_is_free() -> None:
    aisle = np.array([[[3.0, 0.5], [8.0, 0.5]], [[3.0, 1.5], [8.0, 1.5]]])
    world = World(Planner(FloorMap.build(np.concatenate([WALLS, aisle])), 0.25))
    world.person = person = Disc(5.5, 1.0, 0.25)
    world.mission.start((Destination('end', Pose2(7.0, 1.0, 0.0)),))
    drive = world.mission._drive
    while world.now_s < 100.0 and not drive._leg.retreated:
        world.step()
    arrived_s = world.now_s
    while world.now_s < arrived_s + 5.0:
        world.step()
    assert drive._leg.retreated
    assert world.velocity == Velocity()
    course = math.atan2(person.y - world.pose.y, person.x - world.pose.x)
    assert abs(wrap(course - world.pose.heading)) < 0.25  # where it was held up is known to 0.3 m
    drive._ways.is_free = lambda *_: True  # type: ignore[method-assign]
    world.step()
    assert not drive._leg.retreat_until


def test_robot_stands_longer_before_what_holds_it_up_again() -> None:
    """Making way at once, each time, would never tell somebody from something that stays."""
    aisle = np.array([[[3.0, 0.5], [8.0, 0.5]], [[3.0, 1.5], [8.0, 1.5]]])
    world = World(Planner(FloorMap.build(np.concatenate([WALLS, aisle])), 0.25))
    world.person = Disc(5.5, 1.0, 0.25)
    world.mission.start((Destination('end', Pose2(7.0, 1.0, 0.0)),))
    stood_s, standing_s = [], 0.0
    while world.mission.is_busy and world.now_s < 400.0 and len(stood_s) < 2:
        status = world.step()
        standing_s = standing_s + DT if status.state is MissionState.BLOCKED else 0.0
        if any('making way' in event for event in status.events):
            stood_s.append(standing_s)
    first, second = stood_s
    config = MissionConfig()
    assert first == pytest.approx(config.replan_after - config.blocked_after, abs=0.2)
    assert second == pytest.approx(2.0 * config.replan_after - config.blocked_after, abs=0.2)


def test_mission_slows_down_where_caution_says_so() -> None:
    world = World()
    world.mission.start((TABLE,))
    while world.velocity.linear_m_s < 0.55:
        world.step()
    world.mission._ways.caution.hear(nanoseconds(world.now_s + DT), 0.5)
    world.step()
    assert 0.0 < world.velocity.linear_m_s < 0.3


def test_robot_that_stands_for_somebody_does_not_speed_up_first() -> None:
    """It comes to a stand from what it drives, not from what it would drive without caution."""
    world = World()
    world.mission.start((TABLE,))
    while world.velocity.linear_m_s < 0.55:
        world.step()
    for _ in range(3):
        world.mission._ways.caution.hear(nanoseconds(world.now_s + DT), 0.5)
        world.step()
    slow = world.velocity.linear_m_s
    assert 0.0 < slow < 0.3
    world.mission.pause()
    world.step()
    assert world.velocity.linear_m_s < slow
