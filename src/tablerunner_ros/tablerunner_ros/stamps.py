"""Judging stamps by the node's clock; beside other stamps the core judges them."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.node import Node

from tablerunner.config import Config, parameter
from tablerunner.types import nanoseconds

FUTURE = 'stamp in the future'


@dataclass(frozen=True)
class StampConfig(Config):
    """How far a stamp may be ahead of the node's clock."""

    stamp_tolerance: float = parameter(
        0.5,
        unit='s',
        description='How far a stamp may be ahead of the node clock before it is refused',
        low=0.0,
        high=60.0,
    )


class StampCheck:
    """Tells stamps that lie in the future: one of them would make all true ones late."""

    def __init__(self, node: Node, config: StampConfig) -> None:
        self._clock = node.get_clock()
        self._tolerance = nanoseconds(config.stamp_tolerance)

    def is_future(self, stamp: int) -> bool:
        """Return whether a stamp [ns] is ahead of the clock; never before the clock is known.

        Under use_sim_time the clock reads zero until the first /clock, which may well arrive
        after the first measurement.
        """
        # A clock of rclpy makes two objects for each reading; wall time is to be had for less.
        now = self._clock.now().nanoseconds if self._clock.ros_time_is_active else time.time_ns()
        return 0 < now < stamp - self._tolerance
