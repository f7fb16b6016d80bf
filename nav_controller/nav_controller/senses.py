"""What nav_controller hears of the robot: pose, safety stop, ultrasonic sensors, battery."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, Range

from nav_controller.convert import safety_from_message, situation_of
from nav_controller.params import NavNodeConfig
from tablerunner.control import Battery, Situation
from tablerunner.control.fuzzy import Readings, UltrasonicRing
from tablerunner.types import NANOSECONDS, OdometrySample, Refusal
from tablerunner_ros.clocks import now_ns
from tablerunner_ros.conversions.odometry import odometry_from_message
from tablerunner_ros.conversions.ultrasonic import ultrasonic_from_message
from tablerunner_ros.diagnostics import Diagnostics
from tablerunner_ros.qos import qos_for

POSE, ULTRASONIC, BATTERY = 'odometry/filtered', 'ultrasonic', 'battery_state'


class Senses:
    """Keeps the newest of each; what cannot be used is counted on diagnostics.

    Parameters
    ----------
    node : Node
    config : NavNodeConfig
    diagnostics : Diagnostics
    battery : Battery
        Is told each charge.
    """

    def __init__(
        self, node: Node, config: NavNodeConfig, diagnostics: Diagnostics, battery: Battery
    ) -> None:
        self._node = node
        self._frames = config.map_frame, config.base_frame
        self._diagnostics = diagnostics
        self._sample: OdometrySample | None = None
        self._safety: tuple[bool, bool, tuple[float, float] | None] = (False, False, None)
        self._ring = UltrasonicRing(config.ultrasonic_frames)
        self._battery = battery
        self._last = 0
        diagnostics.watch(POSE, config.mission.pose_timeout)
        self._listen(Odometry, POSE, self._on_pose)
        self._listen(DiagnosticStatus, 'safety_state', self._on_safety)
        self._listen(BatteryState, BATTERY, self._on_battery)
        for frame in config.ultrasonic_frames:
            diagnostics.watch(f'{ULTRASONIC}/{frame}', config.reactive.stale_after)
            topic = f'{ULTRASONIC}/' + frame.removeprefix(f'{ULTRASONIC}_')
            self._listen(Range, topic, self._on_range)

    def _listen(self, type_: Any, topic: str, callback: Any) -> None:
        self._node.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))

    def situation(self, stamp: int) -> Situation:
        """Return what a mission is to know at `stamp` [ns]."""
        if stamp < self._last - NANOSECONDS:  # a bag that was started again
            self._ring.reset()
            self._sample = None
        self._last = stamp
        return situation_of(stamp, self._sample, *self._safety)

    def readings(self, stamp: int) -> Readings:
        """Return what the five ultrasonic sensors heard last."""
        return self._ring.readings(stamp)

    def _on_pose(self, message: Odometry) -> None:
        sample = odometry_from_message(message, *self._frames, POSE)
        if isinstance(sample, Refusal):
            self._diagnostics.refuse(sample)
            return
        self._diagnostics.take(POSE, sample.stamp)
        self._sample = sample

    def _on_safety(self, message: DiagnosticStatus) -> None:
        self._safety = safety_from_message(message)

    def _on_battery(self, message: BatteryState) -> None:
        now = now_ns(self._node)
        refusal = self._battery.take(message.percentage, now, BATTERY)
        if refusal is not None:
            self._diagnostics.refuse(refusal)
        else:
            self._diagnostics.take(BATTERY, now)

    def _on_range(self, message: Range) -> None:
        sample = ultrasonic_from_message(message)
        refusal = sample
        if not isinstance(sample, Refusal):
            refusal = self._ring.add(sample, now_ns(self._node))
        source = f'{ULTRASONIC}/{message.header.frame_id}'
        if refusal is not None:
            self._diagnostics.refuse(Refusal(refusal.stamp, source, '', refusal.reason))
        else:
            self._diagnostics.take(source, sample.stamp)
