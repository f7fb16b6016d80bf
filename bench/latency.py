"""From uwb/exchanges to odometry/filtered through our nodes, against two that only relay."""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rclpy
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from result import Result, latencies
from sensor_msgs.msg import JointState

from tablerunner_interfaces.msg import UwbExchange
from tablerunner_ros.executor import make_executor
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.process import Processes

EXCHANGES = 600
RATE_HZ = 40.0
TICKS_PER_M = 128 * 499.2e6 / 299_702_547.0
ANCHORS = [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]
PLACE = (5.0, 6.0, 1.1)


class Harness:
    """Publishes exchanges at their rate and notes when each came out at the far end."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = Node('bench', context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self.node)
        self._exchanges = self.node.create_publisher(
            UwbExchange, 'uwb/exchanges', qos_profile_sensor_data
        )
        self._wheels = self.node.create_publisher(
            JointState, 'joint_states', qos_for('joint_states')
        )
        self._sent: dict[int, float] = {}
        self._number = 0
        self.taken: list[float] = []

    def arrived(self, message: Any) -> None:
        """Take a message from the far end; other stamps than those sent are odometry's own."""
        now = time.perf_counter()
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        begun = self._sent.pop(stamp, None)
        if begun is not None:
            self.taken.append(now - begun)

    def run(self, done: Callable[[], bool], limit_s: float) -> None:
        """Publish at the contract's rates until `done`."""
        begun = time.monotonic()
        due, wheels_due = begun, begun
        while not done():
            now = time.monotonic()
            if now - begun > limit_s:
                raise RuntimeError(f'only {len(self.taken)} exchanges came through')
            if now >= wheels_due:
                wheels_due += 0.02
                self._wheels.publish(self._still())
            if now >= due:
                due += 1.0 / RATE_HZ
                self._send()
            self._executor.spin_once(timeout_sec=max(0.0, min(due, wheels_due) - time.monotonic()))

    def _still(self) -> JointState:
        message = JointState(name=['left_wheel_joint', 'right_wheel_joint'])
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.position, message.velocity = [0.0, 0.0], [0.0, 0.0]
        return message

    def _send(self) -> None:
        self._number += 1
        anchor = self._number % 4
        flight = round(math.dist(PLACE, ANCHORS[anchor]) * TICKS_PER_M)
        reply, now = 60_000_000, self.node.get_clock().now()
        message = UwbExchange(anchor_id=f'A{anchor}', tag_id='tag', sequence=self._number)
        message.header.stamp = now.to_msg()
        message.header.frame_id = 'uwb_tag'
        message.poll_rx, message.response_tx = flight, flight + reply
        message.response_rx, message.final_tx = 2 * flight + reply, 2 * flight + 2 * reply
        message.final_rx = 3 * flight + 2 * reply
        self._sent[now.nanoseconds] = time.perf_counter()
        self._exchanges.publish(message)

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


def run(start: Callable[[Processes], None], far: tuple[type[Any], str, Any]) -> list[float]:
    """Return the latencies [s] through what `start` starts."""
    with tempfile.TemporaryDirectory() as folder, lease_domain() as domain:
        processes = Processes(domain, Path(folder))
        harness = Harness(domain)
        try:
            type_, topic, qos = far
            harness.node.create_subscription(type_, topic, harness.arrived, qos)
            start(processes)
            harness.run(lambda: len(harness.taken) >= 100, 60.0)  # discovery, caches, the start
            harness.taken.clear()
            harness.run(lambda: len(harness.taken) >= EXCHANGES, 60.0)
            return harness.taken
        finally:
            harness.close()
            processes.close()


def ours() -> list[float]:
    """Return the latencies through the real nodes."""

    def start(processes: Processes) -> None:
        anchors = [number for place in ANCHORS for number in place]
        ids = [f'A{k}' for k in range(4)]
        processes.node(
            'uwb_driver', 'uwb_driver', {'anchor_ids': ids, 'anchor_positions': anchors}
        )
        processes.node('odom_node', 'odom_node', {'heading_source': 'wheels'})
        pose = [PLACE[0], PLACE[1], 0.0]
        processes.node('fusion_node', 'fusion_node', {'initial_pose': pose})

    return run(start, (Odometry, 'odometry/filtered', qos_for('odometry/filtered')))


def relays() -> list[float]:
    """Return the latencies through two relays."""

    def start(processes: Processes) -> None:
        relay = str(Path(__file__).with_name('relay.py'))
        processes.start(sys.executable, relay, 'uwb/exchanges', 'relayed')
        processes.start(sys.executable, relay, 'relayed', 'relayed_twice')

    return run(start, (UwbExchange, 'relayed_twice', qos_profile_sensor_data))


def measure() -> Iterator[Result]:
    """Measure both, in turn, twice: the machine may be busier at one time than at another."""
    own, passed = ours(), relays()
    own += ours()
    passed += relays()
    yield from latencies(
        'latency',
        own,
        passed,
        'uwb/exchanges to odometry/filtered; reference: two nodes that pass UwbExchange on',
    )
