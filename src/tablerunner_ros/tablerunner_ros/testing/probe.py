"""A node of the test's own that publishes to, listens to and asks the nodes under test."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher

from tablerunner_ros.executor import make_executor
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.waiting import LIMIT_S

T = TypeVar('T')

ASK_AGAIN_S = 1.0
"""Wait for an answer of a service before the request is sent once more."""

DEPTH = 1000
"""Queue of what a probe listens to: a busy machine must not make a test lose messages."""


class Probe:
    """Speaks and listens in one domain; everything runs in the calling thread, while it waits.

    Attributes
    ----------
    node : rclpy.node.Node
        The probe's own node.
    context : rclpy.context.Context
        Private to the probe; for nodes that a test runs in its own process (`host`).
    """

    def __init__(self, domain: int, name: str = 'probe') -> None:
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = Node(name, context=self.context)
        self._executor = make_executor(self.context)
        self._executor.add_node(self.node)
        self._hosted: list[Node] = []
        self._publishers: dict[str, Publisher] = {}
        self._received: dict[str, list[Any]] = {}
        self.listen(DiagnosticArray, 'diagnostics')

    def host(self, make: Callable[..., Node], **options: Any) -> Node:
        """Run a node under test in this process: `make(context=..., **options)`."""
        node = make(context=self.context, **options)
        self._hosted.append(node)
        self._executor.add_node(node)
        return node

    def listen(self, type_: type[T], topic: str) -> list[T]:
        """Subscribe to a topic of the contract; return the list that its messages are put into."""
        if topic not in self._received:
            self._received[topic] = []
            profile = qos_for(topic, subscriber=True)
            profile.depth = DEPTH
            self.node.create_subscription(type_, topic, self._received[topic].append, profile)
        return self._received[topic]

    def speak(self, type_: type[Any], topic: str) -> Publisher:
        """Return a publisher on a topic of the contract, made at the first call."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(type_, topic, qos_for(topic))
        return self._publishers[topic]

    def publish(self, topic: str, *messages: Any) -> None:
        """Publish messages on a topic of the contract."""
        publisher = self.speak(type(messages[0]), topic)
        for message in messages:
            publisher.publish(message)

    def repeat(
        self,
        topic: str,
        make: Callable[[], Any],
        until: Callable[[], T],
        what: str,
        limit_s: float = LIMIT_S,
        period_s: float = 0.05,
    ) -> T:
        """Publish what `make` returns again and again until a condition holds; return that.

        For best-effort topics of other processes: what is published before the other side knows
        of this one is lost, and nobody can tell from here.
        """
        last = -period_s

        def step() -> T:
            nonlocal last
            now = time.monotonic()
            if now - last >= period_s:
                last = now
                self.publish(topic, make())
            return until()

        return self.wait_for(step, what, limit_s)

    def connected(self, topic: str, limit_s: float = LIMIT_S) -> None:
        """Wait until this side knows a subscriber of what the probe publishes on a topic.

        To a node in this process nothing is lost then; to others see `repeat`.
        """
        publisher = self._publishers[topic]
        self.wait_for(
            lambda: publisher.get_subscription_count() > 0, f'a subscriber of {topic}', limit_s
        )

    def heard(self, topic: str, limit_s: float = LIMIT_S) -> None:
        """Wait until somebody publishes what the probe listens to on a topic."""
        self.wait_for(
            lambda: self.node.count_publishers(topic) > 0, f'a publisher of {topic}', limit_s
        )

    def spin(self, duration_s: float) -> None:
        """Let things happen for a while; for showing that something does *not* happen."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def wait_for(self, condition: Callable[[], T], what: str, limit_s: float = LIMIT_S) -> T:
        """Spin until `condition` returns something true, and return that; else AssertionError."""
        end = time.monotonic() + limit_s
        while True:
            result = condition()
            if result:
                return result
            if time.monotonic() > end:
                raise AssertionError(f'waited {limit_s:g} s in vain for {what}')
            self._executor.spin_once(timeout_sec=0.02)

    def diagnostic(self, name: str) -> DiagnosticStatus | None:
        """Return the newest status of this name, e.g. ``odom_node: joint_states``."""
        arrays = self.listen(DiagnosticArray, 'diagnostics')
        for array in reversed(arrays):
            for status in array.status:
                if status.name == name:
                    return status
        return None

    def wait_diagnostic(
        self, name: str, key: str, value: str | Callable[[str], bool], limit_s: float = LIMIT_S
    ) -> DiagnosticStatus:
        """Wait until a status has a value under a key (equal, or such that `value` is true)."""

        def found() -> DiagnosticStatus | None:
            status = self.diagnostic(name)
            for item in [] if status is None else status.values:
                if item.key == key and (
                    value(item.value) if callable(value) else item.value == value
                ):
                    return status
            return None

        try:
            return self.wait_for(found, f'{key!r} of {name!r}', limit_s)
        except AssertionError as error:
            raise AssertionError(f'{error}; last seen: {self.diagnostic(name)}') from None

    def set_parameter(self, node: str, name: str, value: Any) -> str:
        """Set a parameter of a node through its service; return '' or why it was refused."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        result = self.call(SetParameters, f'{node}/set_parameters', request).results[0]
        return '' if result.successful else result.reason or 'refused without a reason'

    def get_parameter(self, node: str, name: str) -> Any:
        """Return a parameter's value (a ParameterValue message) through the node's service.

        Afterwards the node knows of everything that this probe had made before: discovery keeps
        the order.
        """
        request = GetParameters.Request(names=[name])
        return self.call(GetParameters, f'{node}/get_parameters', request).values[0]

    def call(self, type_: Any, service: str, request: Any) -> Any:
        """Return the answer of a service; it may be asked more than once."""
        client = self.node.create_client(type_, service)
        try:
            self.wait_for(client.service_is_ready, f'service {service}')
            # An answer is lost when the server has not found this client yet: ask again.
            asked = [client.call_async(request)]
            end = time.monotonic() + ASK_AGAIN_S

            def answer() -> Any:
                nonlocal end
                if time.monotonic() > end:
                    asked.append(client.call_async(request))
                    end = time.monotonic() + ASK_AGAIN_S
                return next((future for future in asked if future.done()), None)

            return self.wait_for(answer, f'an answer of {service}').result()
        finally:
            self.node.destroy_client(client)

    def close(self) -> None:
        """Take everything down."""
        self._executor.shutdown()
        for node in [*self._hosted, self.node]:
            for waitable in list(node.waitables):
                if isinstance(waitable, ActionClient):  # which rclpy leaves, and with it the node
                    waitable.destroy()
            node.destroy_node()
        rclpy.shutdown(context=self.context)
