"""What only asking tells: does DDS work at all, which nodes are there, how are they set."""

from __future__ import annotations

import contextlib
import math
import os
import time
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Empty

from tablerunner.doctor import DiscoveryFacts
from tablerunner_bringup import domains
from tablerunner_bringup.polling import Newest, bare_node

ASKED = {
    'uwb_driver': ('anchor_ids', 'anchor_positions', 'tag_height'),
    'odom_node': ('left_joints', 'right_joints', 'heading_source'),
    'fusion_node': ('tag_position', 'map_frame', 'odom_frame', 'base_frame'),
    'safety_stop': ('ultrasonic_frames',),
    'nav_controller': (),
}
"""Parameters that are asked of each node, beside use_sim_time."""

OPTIONAL = {'uwb_driver': ('serial.port',)}
"""Those that a node may not have: one unknown name in a question leaves all of it unanswered."""

_FIELDS = {
    ParameterType.PARAMETER_BOOL: 'bool_value',
    ParameterType.PARAMETER_INTEGER: 'integer_value',
    ParameterType.PARAMETER_DOUBLE: 'double_value',
    ParameterType.PARAMETER_STRING: 'string_value',
    ParameterType.PARAMETER_DOUBLE_ARRAY: 'double_array_value',
    ParameterType.PARAMETER_STRING_ARRAY: 'string_array_value',
}


def loopback_s(domain: int | None, limit_s: float) -> float:
    """Return how long two participants of this process take to hear each other; NaN for never."""
    topic = f'/tablerunner_doctor_{os.getpid()}'
    with (
        bare_node('tablerunner_doctor_a', domain) as one,
        bare_node('tablerunner_doctor_b', domain) as other,
    ):
        newest = Newest(other, Empty, topic, QoSProfile(depth=1))
        publisher = one.create_publisher(Empty, topic, QoSProfile(depth=1))
        start = time.monotonic()
        while (elapsed := time.monotonic() - start) < limit_s:
            publisher.publish(Empty())
            time.sleep(0.02)
            if newest.poll():
                return elapsed
    return math.nan


def discovery_facts(node: Node, domain: int, loopback: float) -> DiscoveryFacts:
    """Return which nodes are in the namespace of a node and which are elsewhere."""
    here, elsewhere = [], []
    for name, namespace in node.get_node_names_and_namespaces():
        if name.startswith(('tablerunner_doctor', '_')):
            continue
        if namespace.strip('/') == node.get_namespace().strip('/'):
            here.append(name)
        else:
            elsewhere.append(f'{namespace.rstrip("/")}/{name}')
    others = ()
    if not here:
        spoken = (number for number in range(domains.LAST_DOMAIN + 1) if number != domain)
        others = tuple(number for number in spoken if not domains.is_silent(number))
    return DiscoveryFacts(domain, loopback, tuple(here), tuple(elsewhere), others)


def parameters_of(node: Node, names: tuple[str, ...], limit_s: float) -> dict[str, dict[str, Any]]:
    """Return the parameters of those nodes that answer in time, by node and name."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    questions = [
        _Question(node, name, wanted)
        for name in dict.fromkeys(names)
        if name in ASKED
        for wanted in (('use_sim_time', *ASKED[name]), OPTIONAL.get(name, ()))
        if wanted
    ]
    try:
        end = time.monotonic() + limit_s
        while not all(item.answered() for item in questions) and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.02)
    finally:
        executor.remove_node(node)
        with contextlib.suppress(Exception):
            executor.shutdown()
    found: dict[str, dict[str, Any]] = {}
    for item in questions:
        if item.answered():
            found.setdefault(item.name, {}).update(item.values())
        item.close()
    return found


class _Question:
    """Some parameters asked of one node."""

    def __init__(self, node: Node, name: str, wanted: tuple[str, ...]) -> None:
        self.name = name
        self._node = node
        self._wanted = wanted
        self._client = node.create_client(GetParameters, f'{name}/get_parameters')
        self._future: Any = None

    def answered(self) -> bool:
        """Ask as soon as the node can be asked; return whether it has answered."""
        if self._future is None and self._client.service_is_ready():
            self._future = self._client.call_async(GetParameters.Request(names=list(self._wanted)))
        return self._future is not None and self._future.done()

    def values(self) -> dict[str, Any]:
        """Return what was answered."""
        return _values(self._wanted, self._future.result())

    def close(self) -> None:
        """Take the client down."""
        self._node.destroy_client(self._client)


def _values(names: tuple[str, ...], answer: Any) -> dict[str, Any]:
    """Return the values of an answer; one that is not set has no type."""
    found = {}
    for name, value in zip(names, answer.values, strict=False):
        field = _FIELDS.get(value.type)
        if field is not None:
            item = getattr(value, field)
            found[name] = tuple(item) if field.endswith('array_value') else item
    return found
