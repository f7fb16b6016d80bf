"""The lean executor does all that rclpy's does, to nodes with everything in them."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient, ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Int32

from tablerunner_interfaces.action import Deliver
from tablerunner_ros.executor import LeanExecutor, make_executor
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.domain import lease_domain


class Bench:
    """A lean executor with a node, and a second node to talk to it."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.executor = LeanExecutor(context=context)
        self.node = Node('lean', context=context)
        self.other = Node('other', context=context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.other)
        # Bounds each wait: spin_once without a limit waits for work.
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.ticks = 0
        self.other.create_timer(0.01, self._tick, clock=clock)

    def _tick(self) -> None:
        self.ticks += 1

    def until(self, condition: Any, ticks: int = 1000) -> None:
        """Spin until a condition holds."""
        end = self.ticks + ticks
        while not condition():
            assert self.ticks < end, 'waited in vain'
            self.executor.spin_once()

    def connect(self, publisher: Any) -> None:
        """Spin until a publisher has its subscriber."""
        self.until(lambda: publisher.get_subscription_count() > 0)

    def close(self) -> None:
        """Take all down."""
        self.executor.shutdown(0.0)
        self.node.destroy_node()
        self.other.destroy_node()


@pytest.fixture
def bench() -> Iterator[Bench]:
    context = Context()
    with lease_domain() as domain:
        rclpy.init(args=[], context=context, domain_id=domain)
        item = Bench(context)
        yield item
        item.close()
        context.try_shutdown()


def test_make_executor_on_this_rclpy_is_lean(bench: Bench) -> None:
    """What the lean executor stands on is there; should it go, this says so."""
    executor = make_executor(bench.context)
    assert type(executor) is LeanExecutor
    executor.shutdown(0.0)


def test_make_executor_with_other_internals_falls_back(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rclpy that is built differently gets its own executor."""
    monkeypatch.setattr('tablerunner_ros.executor._rclpy', object())
    executor = make_executor(bench.context)
    assert type(executor) is SingleThreadedExecutor
    executor.shutdown(0.0)


def test_executor_subscriptions_get_every_message_in_order(bench: Bench) -> None:
    """Nothing is lost, doubled or swapped."""
    got: list[int] = []
    bench.node.create_subscription(Int32, 'a', lambda message: got.append(message.data), 100)
    publisher = bench.other.create_publisher(Int32, 'a', 100)
    bench.connect(publisher)
    for number in range(100):
        publisher.publish(Int32(data=number))
    bench.until(lambda: len(got) >= 100)
    assert got == list(range(100))


def test_executor_backlog_of_two_topics_is_handled_in_order_of_arrival(bench: Bench) -> None:
    """Two messages on one topic to each on the other, all waiting: none overtakes another."""
    got: list[int] = []

    def keep(message: Int32) -> None:
        got.append(message.data)

    # The slow topic first: rclpy's executor would take one of each in turn.
    bench.node.create_subscription(Int32, 'slow', keep, 100)
    bench.node.create_subscription(Int32, 'fast', keep, 100)
    slow = bench.other.create_publisher(Int32, 'slow', 100)
    fast = bench.other.create_publisher(Int32, 'fast', 100)
    bench.connect(slow)
    bench.connect(fast)
    bench.until(lambda: bench.ticks > 1)  # its first pass has rare work to do, in rclpy's order
    for number in range(60):
        (slow if number % 3 == 2 else fast).publish(Int32(data=number))
    bench.until(lambda: len(got) >= 60)
    assert got == list(range(60))


def test_executor_subscription_destroyed_with_messages_waiting_is_not_called(
    bench: Bench,
) -> None:
    """What waits for a subscription that another's callback destroys is dropped."""
    got: list[str] = []
    publisher = bench.other.create_publisher(Int32, 'a', 10)
    subscriptions = {}

    def callback(name: str, other: str) -> None:
        got.append(name)
        if other in subscriptions:
            bench.node.destroy_subscription(subscriptions.pop(other))

    for name, other in (('first', 'second'), ('second', 'first')):
        subscriptions[name] = bench.node.create_subscription(
            Int32, 'a', lambda message, name=name, other=other: callback(name, other), 10
        )
    bench.until(lambda: publisher.get_subscription_count() == 2)
    publisher.publish(Int32())
    publisher.publish(Int32())
    bench.until(lambda: len(got) >= 2)
    assert len(set(got)) == 1


def test_executor_subscription_with_info_gets_it(bench: Bench) -> None:
    """A callback of two arguments gets the message's information as well."""
    got: list[Any] = []
    bench.node.create_subscription(Int32, 'a', lambda message, info: got.append(info), 10)
    publisher = bench.other.create_publisher(Int32, 'a', 10)
    bench.connect(publisher)
    publisher.publish(Int32())
    bench.until(lambda: got)
    assert got[0]['source_timestamp'] > 0


def test_executor_coroutine_callback_is_awaited(bench: Bench) -> None:
    """Coroutines go through rclpy's tasks."""
    got: list[int] = []

    async def callback(message: Int32) -> None:
        got.append(message.data)

    bench.node.create_subscription(Int32, 'a', callback, 10)
    publisher = bench.other.create_publisher(Int32, 'a', 10)
    bench.connect(publisher)
    publisher.publish(Int32(data=7))
    bench.until(lambda: got)
    assert got == [7]


def test_executor_service_and_client_work(bench: Bench) -> None:
    """Parameters of a node can be read through its services, by a client in the same executor."""
    client = bench.other.create_client(GetParameters, 'lean/get_parameters')
    bench.until(client.service_is_ready)
    future = client.call_async(GetParameters.Request(names=['use_sim_time']))
    bench.until(future.done)
    assert future.result().values[0].bool_value is False


def test_executor_action_works_and_outlives_its_results(bench: Bench) -> None:
    """Goal, feedback, result; then the server's own timer lets the result go."""

    def execute(goal: ServerGoalHandle) -> Deliver.Result:
        goal.publish_feedback(Deliver.Feedback(state='driving'))
        goal.succeed()
        return Deliver.Result(success=True)

    server = ActionServer(bench.node, Deliver, 'deliver', execute, result_timeout=1)
    client = ActionClient(bench.other, Deliver, 'deliver')
    bench.until(client.server_is_ready)
    told: list[str] = []
    accepted = client.send_goal_async(
        Deliver.Goal(), lambda message: told.append(message.feedback.state)
    )
    bench.until(accepted.done)
    result = accepted.result().get_result_async()
    bench.until(lambda: result.done() and told)
    assert result.result().result.success
    assert told == ['driving']
    # A second later the server's timer lets the result go.
    end = bench.ticks + 150
    bench.until(lambda: bench.ticks > end)
    server.destroy()
    client.destroy()


def test_executor_after_rare_work_is_lean_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One service call does not leave it on rclpy's slow way for good."""
    client = bench.other.create_client(GetParameters, 'lean/get_parameters')
    bench.until(client.service_is_ready)
    bench.until(client.call_async(GetParameters.Request(names=['use_sim_time'])).done)
    slow: list[int] = []
    true_way = SingleThreadedExecutor.spin_once

    def watched(executor: Any, timeout_sec: float | None = None) -> None:
        slow.append(1)
        true_way(executor, timeout_sec)

    monkeypatch.setattr(SingleThreadedExecutor, 'spin_once', watched)
    end = bench.ticks + 50
    bench.until(lambda: bench.ticks >= end)
    assert len(slow) < 5


def test_executor_events_of_publishers_are_looked_at(bench: Bench) -> None:
    """A subscriber that asks for more than is offered is reported, within a second or two."""
    events: list[Any] = []
    bench.node.create_publisher(
        Int32,
        'c',
        qos_for('imu/data'),
        event_callbacks=PublisherEventCallbacks(incompatible_qos=events.append),
    )
    bench.other.create_subscription(Int32, 'c', lambda message: None, qos_for('odom'))
    bench.until(lambda: events)


def test_executor_entities_that_come_and_go_are_noticed(bench: Bench) -> None:
    """A subscription made in a callback works; one destroyed in a callback is never called."""
    late: list[int] = []
    first: list[int] = []
    publisher = bench.other.create_publisher(Int32, 'b', 10)

    def swap(message: Int32) -> None:
        first.append(message.data)
        bench.node.destroy_subscription(subscription)
        bench.node.create_subscription(Int32, 'b', lambda item: late.append(item.data), 10)

    subscription = bench.node.create_subscription(Int32, 'b', swap, 10)
    bench.connect(publisher)
    publisher.publish(Int32(data=1))
    bench.until(lambda: first)

    def again() -> bool:
        publisher.publish(Int32(data=2))
        return bool(late)

    bench.until(again)
    assert first == [1]
    assert set(late) == {2}


def test_executor_guard_condition_calls_back(bench: Bench) -> None:
    """Triggered from another thread, as drivers do."""
    called: list[int] = []
    guard = bench.node.create_guard_condition(lambda: called.append(1))
    bench.executor.spin_once(0.0)
    thread = threading.Timer(0.05, guard.trigger)
    thread.start()
    bench.until(lambda: called)
    thread.join()
    end = bench.ticks + 10
    bench.until(lambda: bench.ticks >= end)
    assert called == [1]


def test_executor_guard_condition_may_be_a_coroutine(bench: Bench) -> None:
    """That is left to rclpy."""
    called: list[int] = []

    async def call() -> None:
        called.append(1)

    guard = bench.node.create_guard_condition(call)
    bench.executor.spin_once(0.0)
    guard.trigger()
    bench.until(lambda: called)
    assert called == [1]


def test_executor_timer_that_is_cancelled_stops(bench: Bench) -> None:
    """A cancelled timer does not fire, nor does it keep the executor busy."""
    fired: list[int] = []
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    timer = bench.node.create_timer(0.02, lambda: fired.append(bench.ticks), clock=clock)
    bench.until(lambda: fired)
    timer.cancel()
    count, ticks = len(fired), bench.ticks
    passes = 0
    while bench.ticks < ticks + 10:
        bench.executor.spin_once()
        passes += 1
    assert len(fired) == count
    assert passes < 40


def test_executor_task_from_another_thread_makes_it_return(bench: Bench) -> None:
    """`create_task` is how spin_node tells it to end."""
    bench.executor.remove_node(bench.other)  # and with it the timer that bounds the waits
    done: list[int] = []
    thread = threading.Timer(0.1, lambda: bench.executor.create_task(lambda: done.append(1)))
    thread.start()
    while not done:
        bench.executor.spin_once()
    thread.join()


def test_executor_with_a_time_limit_returns_in_time(bench: Bench) -> None:
    """Without work it comes back when the time is up, with work at once."""
    bench.executor.remove_node(bench.other)
    bench.executor.spin_once(0.0)
    begun = time.monotonic()
    while time.monotonic() < begun + 0.1:
        bench.executor.spin_once(0.05)
    assert time.monotonic() - begun < 5.0
    bench.node.create_timer(0.01, lambda: None, clock=Clock(clock_type=ClockType.STEADY_TIME))
    begun = time.monotonic()
    for _ in range(5):
        bench.executor.spin_once(60.0)
    assert time.monotonic() - begun < 30.0


def test_executor_exception_in_callback_is_raised(bench: Bench) -> None:
    """An error in a callback ends the spinning; it is not swallowed."""

    def fail() -> None:
        raise ValueError('on purpose')

    bench.node.create_timer(0.01, fail, clock=Clock(clock_type=ClockType.STEADY_TIME))
    with pytest.raises(ValueError, match='on purpose'):
        bench.until(lambda: False)


def test_executor_context_shut_down_ends_the_wait(bench: Bench) -> None:
    """Shutting the context down from outside ends the spinning as with rclpy."""
    bench.executor.remove_node(bench.other)
    thread = threading.Timer(0.1, bench.context.try_shutdown)
    thread.start()
    with pytest.raises(ExternalShutdownException):
        bench.until(lambda: False)
    thread.join()
