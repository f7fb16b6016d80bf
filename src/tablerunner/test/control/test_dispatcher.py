"""Deliveries one after the other, home when it is due, and what a restart leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.control import (
    Battery,
    BatteryConfig,
    Delivery,
    DeliveryQueue,
    Destination,
    Dispatcher,
    DispatchStep,
    Ended,
    FloorMap,
    FollowerConfig,
    Mission,
    MissionConfig,
    MissionState,
    Planner,
    PurePursuit,
    Situation,
    Tour,
    VelocityLimits,
)
from tablerunner.errors import MissionError, PlanningError
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import polygon_edges
from tablerunner.types import nanoseconds

WALLS = polygon_edges(np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]]))
PLANNER = Planner(FloorMap.build(WALLS, resolution=0.2), 0.25)
HOME = Destination('kitchen', Pose2(1.0, 1.0, 0.0))
TABLES = {
    'table_1': Destination('table_1', Pose2(2.5, 1.0, 0.0)),
    'table_2': Destination('table_2', Pose2(2.5, 2.5, 1.5), wait_s=1.0),
    'table_3': Destination('table_3', Pose2(4.0, 3.0, 0.0), confirm_s=3.0),
}
DT = 0.1


class World:
    """An ideal robot, and all that was kept on its disk."""

    def __init__(
        self, queue: DeliveryQueue | None = None, config: MissionConfig | None = None
    ) -> None:
        controller = PurePursuit(FollowerConfig(), VelocityLimits())
        mission = Mission(config or MissionConfig(), PLANNER, controller, HOME)
        self.battery = Battery(BatteryConfig(min_charge=0.2, timeout=1e6))
        self.kept = DeliveryQueue() if queue is None else queue
        self.disk_full = False
        self.dispatcher = Dispatcher(mission, self.battery, 4, queue, self.save)
        self.pose, self.now_s = HOME.pose, 10.0
        self.ended: list[Ended] = []
        self.events: list[str] = []

    def save(self, queue: DeliveryQueue) -> None:
        """Keep a queue, unless the disk is full."""
        if self.disk_full:
            raise MissionError('the queue cannot be kept: disk full')
        self.kept = queue

    @property
    def now(self) -> int:
        """The time [ns]."""
        return nanoseconds(self.now_s)

    def order(self, name: str, *tables: str, home: bool = False, queue: bool = True) -> None:
        """Submit a delivery to some tables."""
        stops = tuple(TABLES[table] for table in tables)
        tour = self.dispatcher.mission.tour_of(stops, home)
        self.dispatcher.submit(Delivery(name, tour), self.now, queue)

    def step(self) -> DispatchStep:
        """Advance by one control step."""
        self.now_s += DT
        step = self.dispatcher.step(Situation(self.now, self.pose, self.now, 0.05, 0.05))
        turn, way = step.velocity.angular_rad_s * DT, step.velocity.linear_m_s * DT
        self.pose = self.pose @ Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)
        self.ended += step.ended
        self.events += step.events
        return step

    def until(self, state: MissionState, limit_s: float = 60.0) -> DispatchStep:
        """Go on until the mission is in a state."""
        for _ in range(int(limit_s / DT)):
            step = self.step()
            if step.status.state is state:
                return step
        raise AssertionError(f'never {state.value}: {self.events}')

    def rest(self, limit_s: float = 200.0) -> list[Ended]:
        """Go on until nothing is left to do; return all that has ended."""
        for _ in range(int(limit_s / DT)):
            self.step()
            if not (self.dispatcher.queue or self.dispatcher.mission.is_busy):
                return self.ended
        raise AssertionError(f'not done after {limit_s} s: {self.events}')


def test_deliveries_are_served_in_their_order() -> None:
    world = World()
    world.order('a', 'table_1')
    world.order('b', 'table_2', 'table_1', home=True)
    world.order('c', 'table_1', home=True)
    assert [world.dispatcher.queue.place(name) for name in 'abc'] == [0, 1, 2]
    ended = world.rest()
    assert [item.id for item in ended] == ['a', 'b', 'c']
    assert all(item.state is MissionState.DONE for item in ended)
    assert ended[1].tour.reached == ('table_2', 'table_1', 'kitchen')
    assert world.kept == DeliveryQueue()


def test_delivery_that_does_not_want_to_wait_is_refused_while_busy() -> None:
    world = World()
    world.order('a', 'table_1', queue=False)
    world.step()
    with pytest.raises(MissionError, match='busy'):
        world.order('b', 'table_1', queue=False)
    assert world.dispatcher.queue.place('b') is None


def test_full_queue_and_the_same_delivery_twice_are_refused() -> None:
    world = World()
    for name in 'abc':
        world.order(name, 'table_1')
    with pytest.raises(MissionError, match='twice'):
        world.order('a', 'table_1')
    world.order('d', 'table_1')
    with pytest.raises(MissionError, match='the queue is full: 4'):
        world.order('e', 'table_1')


def test_bad_stop_is_refused_at_once_and_not_at_its_turn() -> None:
    world = World()
    world.order('a', 'table_1')
    tour = Tour((Destination('table_9', Pose2(9.0, 1.0)),))
    with pytest.raises(PlanningError, match=r'table_9: .*outside the room'):
        world.dispatcher.submit(Delivery('b', tour), world.now, True)
    assert len(world.dispatcher.queue) == 1


def test_delivery_is_taken_only_once_it_is_kept() -> None:
    world = World()
    world.disk_full = True
    with pytest.raises(MissionError, match='disk full'):
        world.order('a', 'table_1')
    assert not world.dispatcher.queue


def test_disk_that_fails_later_is_told_and_the_work_goes_on() -> None:
    world = World()
    world.order('a', 'table_1', 'table_2')
    world.disk_full = True
    assert world.rest()[0].state is MissionState.DONE
    assert 'disk full' in world.dispatcher.fault
    assert any('disk full' in event for event in world.events)


def test_waiting_delivery_can_be_cancelled() -> None:
    world = World()
    world.order('a', 'table_1')
    world.order('b', 'table_2', home=True)
    world.order('c', 'table_1')
    world.step()
    assert world.dispatcher.cancel('b')
    assert not world.dispatcher.cancel('b')
    assert world.dispatcher.queue.place('c') == 1
    ended = world.rest()
    assert [item.id for item in ended] == ['b', 'a', 'c']
    assert ended[0].state is MissionState.CANCELLED
    assert ended[0].tour.missed == (('table_2', 'cancelled'), ('kitchen', 'cancelled'))


def test_cancelled_delivery_gives_way_to_the_next() -> None:
    world = World()
    world.order('a', 'table_2')
    world.order('b', 'table_1')
    world.until(MissionState.DRIVING)
    world.dispatcher.cancel_current()
    ended = world.rest()
    assert [(item.id, item.state.value) for item in ended] == [('a', 'cancelled'), ('b', 'done')]
    with pytest.raises(MissionError, match='nothing to cancel'):
        world.dispatcher.cancel_current()


def at_home(world: World) -> bool:
    return world.pose.distance_to(HOME.pose) < 0.25


@pytest.mark.parametrize('home', [True, False])
def test_robot_goes_home_after_a_cancelled_delivery_if_it_is_to(home: bool) -> None:
    world = World(config=MissionConfig(home_after_cancel=home))
    world.order('a', 'table_2')
    world.until(MissionState.WAITING)
    world.dispatcher.cancel('a')
    ended = world.rest()
    assert ended[0].state is MissionState.CANCELLED
    assert at_home(world) is home


def test_robot_goes_home_on_request_and_a_delivery_comes_before_that() -> None:
    world = World()
    world.order('a', 'table_2')
    world.until(MissionState.DRIVING)
    with pytest.raises(MissionError, match='busy'):
        world.dispatcher.go_home()
    world.rest()
    world.dispatcher.go_home()
    for _ in range(20):
        world.step()
    assert not at_home(world)
    world.order('b', 'table_1', queue=False)
    assert world.rest()[-1].id == 'b'
    assert not at_home(world)
    world.dispatcher.go_home()
    world.rest()
    assert at_home(world)
    assert [item.id for item in world.ended] == ['a', 'b']


def test_low_battery_takes_no_delivery_and_no_goal() -> None:
    world = World()
    world.battery.take(0.12, world.now)
    with pytest.raises(MissionError, match='battery too low: 12 %, at least 20 % is needed'):
        world.order('a', 'table_1')
    with pytest.raises(MissionError, match='battery too low'):
        world.dispatcher.go((TABLES['table_1'],), world.now)
    world.battery.take(0.5, world.now)
    world.order('a', 'table_1')


def test_unknown_charge_is_allowed_and_said() -> None:
    world = World()
    world.battery.take(math.nan, world.now)
    world.order('a', 'table_1')
    assert world.rest()[0].state is MissionState.DONE
    assert 'battery charge not known' in world.events


def test_battery_that_runs_low_ends_the_work_at_home() -> None:
    """The delivery under way is finished, the next waits at home until the battery allows."""
    world = World()
    world.order('a', 'table_2', 'table_1')
    world.order('b', 'table_1')
    world.until(MissionState.DRIVING)
    world.battery.take(0.1, world.now)
    for _ in range(600):
        world.step()
    assert [item.id for item in world.ended] == ['a']
    assert world.ended[0].tour.reached == ('table_2', 'table_1')
    assert at_home(world)
    assert not world.dispatcher.mission.is_busy
    assert world.kept.first.id == 'b'
    with pytest.raises(MissionError, match='battery too low'):
        world.order('c', 'table_1')
    world.battery.take(0.9, world.now)
    assert [item.id for item in world.rest()] == ['a', 'b']


def test_robot_that_is_home_on_a_low_battery_stays() -> None:
    world = World()
    world.order('a', 'table_1', home=True)
    world.until(MissionState.DRIVING)
    world.battery.take(0.1, world.now)
    world.rest()
    for _ in range(20):
        world.step()
    assert not any('going home' in event for event in world.events)


def test_goal_never_disturbs_a_delivery_and_replaces_a_goal() -> None:
    world = World()
    world.dispatcher.go((TABLES['table_3'],), world.now)
    world.until(MissionState.DRIVING)
    with pytest.raises(MissionError, match='busy'):
        world.order('a', 'table_1', queue=False)
    world.dispatcher.go((TABLES['table_1'],), world.now)
    world.until(MissionState.DONE)
    assert world.pose.distance_to(TABLES['table_1'].pose) < 0.25
    world.order('a', 'table_2')
    with pytest.raises(MissionError, match='busy with a delivery'):
        world.dispatcher.go((TABLES['table_1'],), world.now)


def test_restart_goes_on_with_the_stop_that_was_next() -> None:
    """Ended in the middle of the second stop's hand-over: the first is not served again."""
    world = World()
    world.order('a', 'table_1', 'table_3', home=True)
    world.order('b', 'table_2')
    world.until(MissionState.HANDING_OVER)
    again = World(world.kept)
    again.pose, again.now_s = world.pose, world.now_s
    assert again.step().events[0] == '2 deliveries were left over: going on'
    again.until(MissionState.HANDING_OVER)
    again.dispatcher.mission.confirm()
    ended = again.rest()
    assert [item.id for item in ended] == ['a', 'b']
    assert ended[0].tour.reached == ('table_1', 'table_3', 'kitchen')
    assert ended[0].state is MissionState.DONE
    assert again.events.count('reached table_1') == 0


def test_delivery_that_was_left_over_and_is_impossible_now_is_given_up() -> None:
    gone = Tour((Destination('table_9', Pose2(9.0, 1.0)),))
    world = World(DeliveryQueue((Delivery('a', gone),)))
    world.order('b', 'table_1')
    ended = world.rest()
    assert [(item.id, item.state.value) for item in ended] == [('a', 'failed'), ('b', 'done')]
    assert 'outside the room' in ended[0].tour.missed[0][1]


ORDERS = st.lists(
    st.lists(st.sampled_from(['table_1', 'table_2']), min_size=1, max_size=2),
    min_size=1,
    max_size=3,
)


@given(ORDERS, st.lists(st.floats(0.0, 15.0), max_size=2), st.booleans())
@settings(max_examples=12, deadline=None)
def test_no_restart_loses_or_repeats_a_stop(
    orders: list[list[str]], restarts: list[float], home: bool
) -> None:
    """Restarted at any moment, every delivery ends once, with each stop reached once."""
    world = World()
    for number, tables in enumerate(orders):
        world.order(str(number), *tables, home=home)
    ended: list[Ended] = []
    for after_s in restarts:
        for _ in range(int(after_s / DT)):
            world.step()
        ended += world.ended
        again = World(world.kept)
        again.pose, again.now_s = world.pose, world.now_s
        world = again
    ended += world.rest()
    wanted = [(*tables, 'kitchen') if home else tuple(tables) for tables in orders]
    assert [(item.id, item.tour.reached) for item in ended] == [
        (str(number), stops) for number, stops in enumerate(wanted)
    ]


def test_drive_home_that_is_cancelled_is_not_begun_again() -> None:
    """Who stops the robot on its way home, low battery or not, finds it standing."""
    world = World(config=MissionConfig(home_after_cancel=True))
    world.order('a', 'table_1')
    world.until(MissionState.DRIVING)
    world.battery.take(0.1, world.now)
    world.until(MissionState.RETURNING)
    world.dispatcher.cancel_current()
    for _ in range(20):
        world.step()
    assert not world.dispatcher.mission.is_busy
    assert sum('going home' in event for event in world.events) == 1
