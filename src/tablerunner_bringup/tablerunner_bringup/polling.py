"""Take messages off subscriptions without an executor.

An executor of rclpy costs about 0.1 ms of Python for each message; a program that only wants the
newest of each topic ten times a second, or all of them in batches, takes them itself.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription


def never_called(_message: object) -> None:
    """Stand where rclpy wants a callback; messages are taken by `take_all`."""


def take_all(subscription: Subscription) -> Iterator[tuple[Any, dict[str, int]]]:
    """Yield what waits in a subscription's queue, oldest first, with the middleware's notes.

    The notes hold ``received_timestamp`` [ns, system time] and ``publication_sequence_number``.
    The subscription's node must not be in an executor.
    """
    # The way rclpy's own executor takes messages; rclpy has no public one beside an executor.
    with subscription.handle:
        while True:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            yield taken


class Newest:
    """Keeps the newest message of one topic."""

    def __init__(self, node: Node, type_: Any, topic: str, profile: QoSProfile) -> None:
        self._subscription = node.create_subscription(type_, topic, never_called, profile)
        self.message: Any = None
        self.count = 0

    def poll(self) -> bool:
        """Take what has come; return whether something has."""
        before = self.count
        for message, _ in take_all(self._subscription):
            self.message = message
            self.count += 1
        return self.count > before


@contextlib.contextmanager
def bare_context(domain: int | None = None) -> Iterator[Context]:
    """Make a context whose signals are left to us: one participant of DDS."""
    context = Context()
    rclpy.init(
        args=[],
        context=context,
        domain_id=domain,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)


@contextlib.contextmanager
def bare_node(
    name: str, domain: int | None = None, namespace: str = '', context: Context | None = None
) -> Iterator[Node]:
    """Make a node without services of its own.

    Parameters
    ----------
    name : str
    domain : int, optional
        Of the context that it gets for itself.
    namespace : str
    context : Context, optional
        To share with other nodes of this process. Several should: between participants of one
        process Fast DDS 2 calls across under the locks of both, and can lock up when they end.
    """
    with contextlib.ExitStack() as stack:
        own = stack.enter_context(bare_context(domain)) if context is None else context
        node = Node(
            name,
            context=own,
            namespace=namespace or None,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
        )
        try:
            yield node
        finally:
            node.destroy_node()
