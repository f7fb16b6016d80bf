"""From an ultrasonic reading to zero on cmd_vel: safety_stop against a node that passes on."""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from result import Result, latencies
from sensor_msgs.msg import Range

from tablerunner_ros.executor import make_executor
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.process import Processes

STOPS = 300
PERIOD_S = 0.04
SENSORS = ('left', 'left_front', 'front', 'right_front', 'right')
NEAR_M = 0.1

AT_ONCE = {
    'safety.hold_time': 0.0,
    'safety.hold_time_near': 0.0,
    'safety.memory_time': 0.0,
    'safety.clear_time': 0.0,
    'safety.restart_distance': 0.0,
    'limits.max_acceleration': 1000.0,
}
"""The robot drives on as soon as the way is clear, so that it can be stopped often."""


class Harness:
    """A robot that drives, hears something right before it, and notes when it is told to stand."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = Node('bench', context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._ranges = {
            name: self._node.create_publisher(Range, f'ultrasonic/{name}', qos_for('ultrasonic/*'))
            for name in SENSORS
        }
        self._poses = self._node.create_publisher(
            Odometry, 'odometry/filtered', qos_for('odometry/filtered')
        )
        self._commands = self._node.create_publisher(Twist, 'cmd_vel_nav', qos_for('cmd_vel_nav'))
        self._node.create_subscription(
            Twist, 'cmd_vel', self._on_velocity, qos_for('cmd_vel', subscriber=True)
        )
        self._heard: list[tuple[float, float]] = []

    def _on_velocity(self, message: Twist) -> None:
        self._heard.append((time.perf_counter(), message.linear.x))

    def latency(self, drives: bool) -> float | None:
        """Return how long one stop took [s]; None where the robot had not driven before.

        Parameters
        ----------
        drives : bool
            Whether what is measured lets the robot drive: a node that passes on does not.
        """
        for name in SENSORS:
            self._publish_range(name, math.inf)
        self._publish_pose()
        self._commands.publish(_twist(0.3))
        self._heard.clear()
        self._spin(PERIOD_S)
        if drives and not (self._heard and self._heard[-1][1] > 0.0):
            return None
        self._heard.clear()
        begun = time.perf_counter()
        self._publish_range('front', NEAR_M)
        while time.perf_counter() - begun < 1.0:
            self._executor.spin_once(timeout_sec=0.1)
            for at, speed in self._heard:
                if speed == 0.0:
                    return at - begun
        return None

    def _spin(self, duration_s: float) -> None:
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def _publish_range(self, name: str, distance_m: float) -> None:
        message = Range(field_of_view=0.48, min_range=0.03, max_range=3.0, range=distance_m)
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = f'ultrasonic_{name}'
        self._ranges[name].publish(message)

    def _publish_pose(self) -> None:
        message = Odometry(child_frame_id='base_link')
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = 'map'
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[0] = message.pose.covariance[7] = 0.0025
        message.pose.covariance[35] = 0.0025
        message.twist.twist.linear.x = 0.3
        self._poses.publish(message)

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


def _twist(linear_m_s: float) -> Twist:
    message = Twist()
    message.linear.x = linear_m_s
    return message


def run(start: Callable[[Processes], Any], drives: bool, stops: int = STOPS) -> list[float]:
    """Return the latencies [s] through what `start` starts."""
    with tempfile.TemporaryDirectory() as folder, lease_domain() as domain:
        processes = Processes(domain, Path(folder))
        harness = Harness(domain)
        try:
            start(processes)
            taken: list[float] = []
            until = time.monotonic() + 120.0
            while len(taken) < 20 + stops:  # the first twenty: discovery, caches
                found = harness.latency(drives)
                if found is not None:
                    taken.append(found)
                if time.monotonic() > until:
                    raise RuntimeError(f'only {len(taken)} stops')
            return taken[20:]
        finally:
            harness.close()
            processes.close()


def ours(stops: int = STOPS) -> list[float]:
    """Return the latencies of safety_stop."""
    return run(lambda some: some.node('nav_controller', 'safety_stop', AT_ONCE), True, stops)


def relay(stops: int = STOPS) -> list[float]:
    """Return the latencies of a node that answers each reading with a zero."""
    script = str(Path(__file__).with_name('range_relay.py'))
    return run(lambda some: some.start(sys.executable, script), False, stops)


def measure() -> Iterator[Result]:
    """Measure both, in turn, twice: the machine may be busier at one time than at another."""
    own, passed = ours(), relay()
    own += ours()
    passed += relay()
    yield from latencies(
        'safety latency',
        own,
        passed,
        'ultrasonic reading to zero on cmd_vel; reference: a node that answers each reading',
    )
