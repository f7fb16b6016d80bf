"""An executor for nodes that live on subscriptions: the same callbacks at a fraction of the work.

rclpy's SingleThreadedExecutor builds a wait set of every entity anew for each message, wraps each
callback in coroutines and a task, and wakes itself twice more per callback, each time building
the wait set again. `LeanExecutor` keeps one wait set until the entities change and calls
subscriptions, timers and guard conditions directly. Messages that wait together are handled in
the order in which they arrived, whatever their topics: a node that was not scheduled for a while
would otherwise take one message of each topic in turn, and an IMU at twice the rate of the wheels
would fall ever further behind them. Everything rarer (services, clients, actions, coroutines and
tasks) it leaves to the code of rclpy that it inherits. The events of publishers and subscriptions
(a peer asks for another QoS), one or two for each of them, do not wake it: it looks at them once
a second. Measurements: docs/nodes.md.

It stands on internals of rclpy 7.1 (Jazzy); `make_executor` takes rclpy's own executor where they
are missing.
"""

from __future__ import annotations

import inspect
import time
from contextlib import ExitStack
from typing import Any

from rclpy.context import Context
from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.subscription import Subscription

FOREVER_NS = -1
EVENTS_EVERY_S = 1.0
"""How often the events of publishers and subscriptions are looked at, at the soonest."""
MOST_AT_ONCE = 100
"""Messages taken from one of several waiting subscriptions before timers get their turn."""


class LeanExecutor(SingleThreadedExecutor):
    """Runs the callbacks of its nodes in the thread that spins."""

    def __init__(self, *, context: Context | None = None) -> None:
        self._stale = True  # entities came or went: gather them anew
        self._held = ExitStack()  # keeps their handles alive while they are waited for
        self._events_due = 0.0
        super().__init__(context=context)

    def wake(self) -> None:
        """Wake up and gather the entities anew; rclpy calls it when they come or go."""
        self._stale = True
        super().wake()

    def add_node(self, node: Node) -> bool:
        """Add a node."""
        self._stale = True
        return super().add_node(node)

    def remove_node(self, node: Node) -> None:
        """Remove a node."""
        self._stale = True
        super().remove_node(node)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Let go of all entities and stop."""
        self._held.close()
        return super().shutdown(timeout_sec)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for work, at most for `timeout_sec`, and do all that is ready."""
        if self._has_tasks():
            super().spin_once(timeout_sec)
            return
        if self._stale:
            self._gather()
        wait_set = self._wait_set
        wait_set.clear_entities()
        for add, handle in self._entries:
            add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        forever = timeout_sec is None or timeout_sec < 0.0
        wait_set.wait(FOREVER_NS if forever else round(timeout_sec * 1e9))
        if not self._context.ok():
            raise ExternalShutdownException
        if self._is_shutdown:
            return
        self._run_ready(wait_set)
        if time.monotonic() >= self._events_due:
            # Afterwards, when little waits: rclpy takes messages in another order.
            self._events_due = time.monotonic() + EVENTS_EVERY_S
            super().spin_once(0)

    def _run_ready(self, wait_set: Any) -> None:
        for pointer in wait_set.get_ready_entities('timer'):
            # None, here and below: it belongs to a waitable (an action has timers and
            # subscriptions of its own), which says itself that it is ready.
            timer = self._timers.get(pointer)
            if timer is not None and timer.handle.is_timer_ready():
                timer.handle.call_timer()
                timer.callback()
        rare = False
        ready: list[Subscription] = []
        for pointer in wait_set.get_ready_entities('subscription'):
            subscription = self._subscriptions.get(pointer)
            if subscription is None:
                rare = True
            else:
                ready.append(subscription)
        for subscription, taken in _arrivals(ready):
            if self._stale and not _is_alive(subscription):
                continue  # destroyed by a callback just now
            if subscription._callback_type is Subscription.CallbackType.MessageOnly:  # noqa: SLF001
                subscription.callback(taken[0])
            else:
                subscription.callback(*taken)
        for pointer in wait_set.get_ready_entities('guard_condition'):
            guard = self._guards.get(pointer)
            if guard is None:  # the executor's own, which has done its work by waking
                continue
            if inspect.iscoroutinefunction(guard.callback):
                guard._executor_triggered = True  # noqa: SLF001
                rare = True
            else:
                guard.callback()
        if (
            rare
            or wait_set.get_ready_entities('service')
            or wait_set.get_ready_entities('client')
            or any(waitable.is_ready(wait_set) for waitable in self._waitables)
        ):
            super().spin_once(0)

    def _has_tasks(self) -> bool:
        """Whether tasks wait to be run or finished; rclpy keeps finished ones for a while."""
        if not self._tasks:
            return False
        with self._tasks_lock:
            self._tasks = [item for item in self._tasks if not item[0].done()]
            return bool(self._tasks)

    def _gather(self) -> None:
        self._held.close()
        self._held = held = ExitStack()
        self._stale = False
        nodes = self.get_nodes()
        subscriptions = _alive(held, [item for node in nodes for item in node.subscriptions])
        timers = _alive(held, [item for node in nodes for item in node.timers])
        guards = _alive(held, [item for node in nodes for item in node.guards])
        services = _alive(held, [item for node in nodes for item in node.services])
        clients = _alive(held, [item for node in nodes for item in node.clients])
        self._waitables = [
            item for node in nodes for item in node.waitables if not isinstance(item, EventHandler)
        ]
        own = [self._guard, self._sigint_gc]
        count = [len(subscriptions), len(guards) + len(own), len(timers), len(clients)]
        count += [len(services), 0]
        for waitable in self._waitables:
            held.enter_context(waitable)
            needs = waitable.get_num_entities()
            for index, name in enumerate(_COUNTS):
                count[index] += getattr(needs, name)
        held.enter_context(self._context.handle)
        self._wait_set = wait_set = _rclpy.WaitSet(*count, self._context.handle)
        # Coroutines need rclpy's tasks.
        self._subscriptions = {
            item.handle.pointer: None if inspect.iscoroutinefunction(item.callback) else item
            for item in subscriptions
        }
        self._timers = {item.handle.pointer: item for item in timers}
        self._guards = {item.handle.pointer: item for item in guards}
        self._entries = [
            *((wait_set.add_subscription, item.handle) for item in subscriptions),
            *((wait_set.add_timer, item.handle) for item in timers),
            *((wait_set.add_guard_condition, item.handle) for item in [*guards, *own]),
            *((wait_set.add_client, item.handle) for item in clients),
            *((wait_set.add_service, item.handle) for item in services),
        ]


_COUNTS = (
    'num_subscriptions',
    'num_guard_conditions',
    'num_timers',
    'num_clients',
    'num_services',
    'num_events',
)


def _arrivals(subscriptions: list[Subscription]) -> list[tuple[Subscription, Any]]:
    """Take what waits for some subscriptions, in order of arrival.

    From a single one only its oldest message: there is nothing to put in order.
    """
    arrivals = []
    for subscription in subscriptions:
        most = 1 if len(subscriptions) == 1 else MOST_AT_ONCE
        for _ in range(most):
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                break
            arrivals.append((subscription, taken))
    if len(arrivals) > 1:
        arrivals.sort(key=_arrival_time)
    return arrivals


def _arrival_time(arrival: tuple[Subscription, Any]) -> int:
    return int(arrival[1][1]['received_timestamp'])


def _is_alive(entity: Any) -> bool:
    """Return whether an entity has not been destroyed."""
    try:
        with entity.handle:
            return True
    except InvalidHandle:
        return False


def _alive(held: ExitStack, entities: list[Any]) -> list[Any]:
    """Hold the handles of those entities that have not been destroyed, and return these."""
    alive = []
    for entity in entities:
        try:
            held.enter_context(entity.handle)
        except InvalidHandle:
            continue
        alive.append(entity)
    return alive


def make_executor(context: Context | None = None) -> SingleThreadedExecutor:
    """Return the lean executor where rclpy has what it stands on, else rclpy's own."""
    parts = [
        (_rclpy, ('WaitSet',)),
        (getattr(_rclpy, 'WaitSet', None), ('clear_entities', 'wait', 'get_ready_entities')),
        (getattr(_rclpy, 'Subscription', None), ('take_message', 'pointer')),
        (getattr(_rclpy, 'Timer', None), ('call_timer', 'is_timer_ready')),
        (Subscription, ('CallbackType',)),
    ]
    complete = all(hasattr(owner, name) for owner, names in parts for name in names)
    return LeanExecutor(context=context) if complete else SingleThreadedExecutor(context=context)
