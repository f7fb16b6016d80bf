"""The node fusion_node: odometry, ranges and poses to the pose in the map and map to odom."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import MagneticField

from fusion_node.output import EstimateOutput, level_of
from fusion_node.params import FusionNodeConfig
from fusion_node.services import FusionServices
from tablerunner.estimation import (
    Localizer,
    LocalizerConfig,
    Outcome,
    SmootherConfig,
)
from tablerunner.types import NANOSECONDS, Refusal
from tablerunner_interfaces.msg import Innovation as InnovationMessage
from tablerunner_interfaces.msg import UwbAnchorArray, UwbRange
from tablerunner_ros.clocks import steady_ns
from tablerunner_ros.conversions.anchors import anchors_from_message
from tablerunner_ros.conversions.imu import magnetic_from_message
from tablerunner_ros.conversions.innovation import innovation_to_message, refusal_to_message
from tablerunner_ros.conversions.odometry import odometry_from_message
from tablerunner_ros.conversions.pose import pose_from_message
from tablerunner_ros.conversions.uwb_range import range_from_message
from tablerunner_ros.diagnostics import Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node
from tablerunner_ros.stamps import FUTURE, StampCheck, StampConfig

ODOM, RANGES, ANCHORS, START = 'odom', 'uwb/ranges', 'uwb/anchors', 'initialpose'
MAGNETIC = 'imu/mag'
_STATE_PERIOD_NS = NANOSECONDS // 5
FIX = 'uwb/pose'  # also made of ranges inside, for estimators that take positions


class FusionNode(Node):
    """Hands every measurement to the localiser and publishes what it then believes.

    odometry/filtered leaves first, since the robot drives by it; the rest follows. Before the
    start is known there is no map to odom, and pose and odometry/filtered carry the variance of a
    heading that is not known.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('fusion_node', **options)
        self._config = config = declare_config(self, FusionNodeConfig)
        self._stamps = StampCheck(self, declare_config(self, StampConfig))
        self._localizer = Localizer(
            declare_config(self, LocalizerConfig, on_change=self._configure)
        )
        self._twist_covariance = np.zeros((2, 2))
        self._measured = {RANGES, FIX, *config.pose_sources}
        self._output = EstimateOutput(
            self, config.map_frame, config.odom_frame, config.base_frame, config.publish_tf
        )
        self._output.configure(
            declare_config(self, SmootherConfig, on_change=self._output.configure)
        )
        self._known, self._told_at = False, 0
        self._innovations = self.create_publisher(
            InnovationMessage, 'innovations', qos_for('innovations')
        )
        self._diagnostics = Diagnostics(self)
        self._diagnostics.watch(ODOM, config.silence)
        self._diagnostics.describe(self._describe)
        self._subscribe(Odometry, ODOM, self._on_odometry)
        self._subscribe(UwbAnchorArray, ANCHORS, self._on_anchors)
        self._subscribe(PoseWithCovarianceStamped, START, partial(self._start, START))
        if config.use_ranges:
            self._diagnostics.watch(RANGES, config.silence)
            self._listen(UwbRange, RANGES, range_from_message, self._localizer.add_range)
        for topic in config.pose_sources:
            convert = partial(pose_from_message, frame=config.map_frame, source=topic)
            self._listen(PoseWithCovarianceStamped, topic, convert, self._localizer.add_pose)
        if self._localizer.config.compass.use:
            self._measured.add(MAGNETIC)
            convert = partial(magnetic_from_message, mount_heading=config.imu_heading)
            self._listen(MagneticField, MAGNETIC, convert, self._localizer.add_magnetic)
        FusionServices(self, self._localizer, self._start)

    def _subscribe(self, type_: type[Any], topic: str, callback: Callable[[Any], None]) -> None:
        self.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))

    def _listen(
        self,
        type_: type[Any],
        topic: str,
        convert: Callable[[Any], Any],
        take: Callable[[Any], Outcome],
    ) -> None:
        """Subscribe to a topic of measurements: convert, one call, publish, count."""
        self._subscribe(type_, topic, partial(self._on_sample, topic, convert, take))

    def _on_odometry(self, message: Odometry) -> None:
        config = self._config
        sample = odometry_from_message(message, config.odom_frame, config.base_frame)
        if self._refused(sample, ODOM):
            return
        outcome = self._localizer.add_odometry(sample)
        self._twist_covariance = sample.twist_covariance
        self._publish(outcome)
        place = self._localizer.map_to_odom
        if place is not None and outcome.estimate is not None:
            self._output.transform(outcome.estimate, place, self._localizer.starts)
        self._tell()
        self._count(outcome, ODOM, sample.stamp)

    def _on_sample(
        self,
        source: str,
        convert: Callable[[Any], Any],
        take: Callable[[Any], Outcome],
        message: Any,
    ) -> None:
        sample = convert(message)
        if self._refused(sample, source):
            return
        outcome = take(sample)
        self._publish(outcome)
        self._tell()
        self._count(outcome, source, sample.stamp)

    def _start(self, source: str, message: PoseWithCovarianceStamped) -> str:
        """Begin anew at a pose that a user gives; return why not, or nothing."""
        sample = pose_from_message(message, self._config.map_frame, source)
        refusal = self._refused(sample, source)
        if refusal is not None:
            return refusal.reason
        outcome = self._localizer.set_pose(sample)
        self._publish(outcome)
        self._tell()
        self._count(outcome, source, sample.stamp)
        if outcome.refusals:
            return outcome.refusals[0].reason
        self.get_logger().info(f'started anew at the pose given by {source}')
        return ''

    def _on_anchors(self, message: UwbAnchorArray) -> None:
        anchors = anchors_from_message(message, self._config.map_frame)
        if isinstance(anchors, Refusal):
            self._refuse(anchors)
            return
        self._localizer.set_anchors(anchors)
        self._diagnostics.take(ANCHORS)

    def _refused(self, sample: Any, source: str) -> Refusal | None:
        """Count and return what was refused in converting it, or for a stamp in the future."""
        refusal = sample if isinstance(sample, Refusal) else None
        if refusal is None and self._stamps.is_future(sample.stamp):
            refusal = Refusal(sample.stamp, source, getattr(sample, 'anchor_id', ''), FUTURE)
        if refusal is not None:
            self._refuse(refusal)
        return refusal

    def _refuse(self, refusal: Refusal) -> None:
        """Count a refusal; one of a measurement that no estimator saw is told as an innovation."""
        self._diagnostics.refuse(refusal)
        if refusal.source in self._measured:
            self._innovations.publish(
                refusal_to_message(
                    refusal, self._config.map_frame, self._localizer.config.estimator
                )
            )

    def _publish(self, outcome: Outcome) -> None:
        estimate = outcome.estimate
        if estimate is None:
            return
        # Also before the start is known: the covariance says so, and nav_controller needs both
        # to find the heading by driving.
        self._output.odometry(estimate, self._localizer.velocity(), self._twist_covariance)
        self._output.pose(estimate)

    def _count(self, outcome: Outcome, source: str, stamp: int) -> None:
        for innovation in outcome.innovations:
            self._innovations.publish(
                innovation_to_message(
                    innovation, self._config.map_frame, self._localizer.config.estimator
                )
            )
            if not innovation.accepted:
                self._diagnostics.refuse(
                    Refusal(stamp, source, innovation.key, innovation.reason), expected=True
                )
                return
        for refusal in outcome.refusals:
            self._refuse(refusal)
        if not outcome.refusals:
            self._diagnostics.take(source, stamp)

    def _tell(self) -> None:
        """Publish the state at once when the pose is lost or found, else now and then.

        To work it out takes about as long as to take a range.
        """
        known, now = self._localizer.estimate is not None, steady_ns()
        if known is not self._known or now - self._told_at >= _STATE_PERIOD_NS:
            self._known, self._told_at = known, now
            self._output.state(self._localizer.status)

    def _configure(self, config: LocalizerConfig) -> None:
        self._localizer.configure(config)

    def _describe(self, report: Report) -> None:
        status = self._localizer.status
        report.add(level_of(status), status.words)
        report.values['state'] = status.state.value
        report.values['pose by'] = '' if status.cause is None else status.cause.value
        report.values['estimator'] = self._localizer.config.estimator
        report.values['without measurement [s]'] = f'{status.dead_reckoning_s:.2f}'
        estimate = self._localizer.estimate
        if estimate is not None:
            deviations = np.sqrt(np.maximum(estimate.covariance.diagonal(), 0.0))
            for name, mean, deviation in zip(
                self._localizer.state_names, estimate.mean, deviations, strict=False
            ):
                report.values[name] = f'{mean:.4f} +- {deviation:.4f}'


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(FusionNode)
