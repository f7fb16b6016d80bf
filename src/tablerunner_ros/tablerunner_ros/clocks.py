"""Ages and stamps by the node's clock, and timers that also run when that clock stands."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from tablerunner.types import NANOSECONDS


def now_ns(node: Node) -> int:
    """Return the node's time [ns]: the simulation's under use_sim_time, 0 before it is known."""
    return int(node.get_clock().now().nanoseconds)


def age_s(node: Node, stamp: int) -> float:
    """Return how old a measurement stamp [ns] is by the node's clock [s]; negative: ahead."""
    return (now_ns(node) - stamp) / NANOSECONDS


def steady_ns() -> int:
    """Return a time [ns] that only goes forward, at the rate of the wall clock."""
    return int(_STEADY.now().nanoseconds)


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Timer:
    """Call back every `period_s` of wall time, also while simulated time stands still."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


_STEADY = Clock(clock_type=ClockType.STEADY_TIME)
