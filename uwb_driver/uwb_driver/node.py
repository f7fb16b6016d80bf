"""The node uwb_driver: exchanges or a device to calibrated ranges and a UWB-only fix."""

from __future__ import annotations

import threading
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node

from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb import (
    DEVICE_SOURCE,
    AnchorHealthConfig,
    AnchorWatch,
    Positioner,
    PositionerConfig,
    Ranger,
    RangerConfig,
)
from tablerunner.uwb.device import EXCHANGES as FROM_EXCHANGES
from tablerunner.uwb.device import Batch, DeviceConfig
from tablerunner_interfaces.msg import UwbAnchorArray, UwbExchange, UwbRange
from tablerunner_ros.clocks import now_ns
from tablerunner_ros.conversions.anchors import anchors_to_message
from tablerunner_ros.conversions.exchange import exchange_from_message
from tablerunner_ros.conversions.pose import pose_to_message
from tablerunner_ros.conversions.uwb_range import fill_range
from tablerunner_ros.diagnostics import WARN, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node
from tablerunner_ros.stamps import FUTURE, StampCheck, StampConfig
from uwb_driver.device_input import DeviceInput, Results
from uwb_driver.health import describe_anchors
from uwb_driver.params import UwbDriverConfig

EXCHANGES = 'uwb/exchanges'


class UwbDriver(Node):
    """Takes exchanges or a device's ranges, publishes the anchors, and solves for the tag's place.

    The ranges leave first; the fix and the counting come after them, since the estimate waits
    for ranges only.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('uwb_driver', **options)
        config = declare_config(self, UwbDriverConfig)
        self._map_frame = config.map_frame
        self._silence = config.silence
        self._stamps = StampCheck(self, declare_config(self, StampConfig))
        device = declare_config(self, DeviceConfig)
        self._source = EXCHANGES if device.device == FROM_EXCHANGES else DEVICE_SOURCE
        ranger = declare_config(self, RangerConfig, on_change=self._configure_ranger)
        positioner = declare_config(self, PositionerConfig, on_change=self._configure_positioner)
        self._ranger = Ranger(ranger)
        self._changing = threading.Lock()  # the ranger: a device's ranges come in another thread
        self._positioner = Positioner(positioner, ranger.anchors)
        health = declare_config(self, AnchorHealthConfig, on_change=self._configure_health)
        self._watch = AnchorWatch(health, ranger.anchor_ids, self._source == DEVICE_SOURCE)
        self._last: dict[str, RangeSample] = {}

        self._range = UwbRange()
        self._range.header.frame_id = config.tag_frame
        self._ranges = self.create_publisher(UwbRange, 'uwb/ranges', qos_for('uwb/ranges'))
        self._fixes = self.create_publisher(
            PoseWithCovarianceStamped, 'uwb/pose', qos_for('uwb/pose')
        )
        self._anchors = self.create_publisher(
            UwbAnchorArray, 'uwb/anchors', qos_for('uwb/anchors')
        )
        self._diagnostics = Diagnostics(self)
        anchors = ranger.anchor_ids
        self._watched = [self._source, *(f'{self._source}/{anchor}' for anchor in anchors)]
        for source in self._watched:
            self._diagnostics.watch(source, config.silence)
        self._diagnostics.describe(self._describe)
        self._anchors.publish(anchors_to_message(ranger.anchors, now_ns(self), self._map_frame))
        self._device: DeviceInput | None = None
        if self._source == EXCHANGES:
            self.create_subscription(
                UwbExchange, EXCHANGES, self._on_exchange, qos_for(EXCHANGES, subscriber=True)
            )
        else:
            self._device = DeviceInput(
                self, device, ranger.anchor_ids, self._on_device, self._after_device
            )
            self._device.start()

    def _on_exchange(self, message: UwbExchange) -> None:
        sample = exchange_from_message(message)
        if self._stamps.is_future(sample.stamp):
            self._diagnostics.refuse(Refusal(sample.stamp, EXCHANGES, sample.anchor_id, FUTURE))
            return
        result = self._ranger.add(sample)
        if isinstance(result, Refusal):
            self._diagnostics.refuse(result)
            return
        self._publish(result)
        self._follow(result)

    def _on_device(self, batch: Batch) -> Results:
        """Publish what a device brought, in the thread that reads it; return what came of it."""
        results: list[RangeSample | Refusal] = list(batch.refusals)
        for sample in batch.ranges:
            if self._stamps.is_future(sample.stamp):
                results.append(Refusal(sample.stamp, DEVICE_SOURCE, sample.anchor_id, FUTURE))
                continue
            with self._changing:
                result = self._ranger.take(sample)
            if isinstance(result, RangeSample):
                self._publish(result)
            results.append(result)
        return results

    def _after_device(self, results: Results) -> None:
        for result in results:
            if isinstance(result, Refusal):
                self._diagnostics.refuse(result)
            else:
                self._follow(result)

    def _publish(self, result: RangeSample) -> None:
        fill_range(self._range, result)
        self._ranges.publish(self._range)

    def _follow(self, result: RangeSample) -> None:
        """Count a range that has left, and solve for the tag's place."""
        self._diagnostics.take(self._source, result.stamp)
        self._diagnostics.take(f'{self._source}/{result.anchor_id}', result.stamp)
        self._last[result.anchor_id] = result
        self._watch.add_range(result)
        fix = self._positioner.add(result)
        if isinstance(fix, Refusal):
            self._diagnostics.refuse(fix)
        elif fix is not None:
            self._fixes.publish(pose_to_message(fix, self._map_frame))
            self._diagnostics.take(fix.source, fix.stamp)
            if self._positioner.last is not None:
                self._watch.add_fix(self._positioner.last)

    def _configure_ranger(self, config: RangerConfig) -> None:
        with self._changing:
            self._ranger.configure(config)

    def _configure_positioner(self, config: PositionerConfig) -> None:
        self._positioner.config = config

    def _configure_health(self, config: AnchorHealthConfig) -> None:
        self._watch.config = config

    def _describe(self, report: Report) -> None:
        if not self._ranger.config.anchor_ids:
            what = 'exchange' if self._device is None else 'range'
            report.add(WARN, f'no anchors given: every {what} is refused (anchor_ids)')
        if self._device is not None:
            self._device.describe(report)
            self._allow_silence(self._device.still_silence_s)
        describe_anchors(report, self._watch, self._last, self._positioner.last)

    def _allow_silence(self, silence_s: float) -> None:
        """Let a tag that stands still be as silent as it says."""
        silence_s = max(silence_s, self._silence)
        for source in self._watched:
            self._diagnostics.allow_silence(source, silence_s)

    def destroy_node(self) -> None:
        """End the reading of the device, then the node."""
        if self._device is not None:
            self._device.stop()
        super().destroy_node()


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(UwbDriver)
