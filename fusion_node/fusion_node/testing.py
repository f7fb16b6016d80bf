"""A robot for tests: it drives in a room with four anchors and tells a fusion_node of it."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from tf2_msgs.msg import TFMessage

from fusion_node.node import FusionNode
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, OdometrySample, PoseSample, RangeSample
from tablerunner_interfaces.msg import Innovation, UwbAnchorArray, UwbRange
from tablerunner_ros.conversions.anchors import anchors_to_message
from tablerunner_ros.conversions.odometry import odometry_to_message
from tablerunner_ros.conversions.pose import pose_to_message
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.conversions.uwb_range import range_to_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process, Processes

ANCHORS = tuple(
    Anchor(name, place)
    for name, place in {
        'A0': (0.0, 0.0, 2.25),
        'A1': (10.0, 0.0, 2.25),
        'A2': (10.0, 10.0, 2.25),
        'A3': (0.0, 10.0, 2.25),
    }.items()
)
TAG_HEIGHT = 1.1
NAN = math.nan
START = Pose2(3.0, 4.0, 0.5)


class Fusion:
    """A fusion_node, a robot that drives in the map, and the probe between.

    Parameters
    ----------
    probe : Probe
    start : Pose2 or None
        Where the node is told to start; the robot starts at `START`.
    processes : Processes or None
        Runs the node as a process there; without it, in this one.
    parameters : object
        Of the node; a double underscore stands for a dot.
    """

    def __init__(
        self,
        probe: Probe,
        start: Pose2 | None = START,
        processes: Processes | None = None,
        **parameters: Any,
    ) -> None:
        self.probe = probe
        given = {'tag_position': [0.0, 0.0, TAG_HEIGHT], **parameters}
        if start is not None:
            given['initial_pose'] = [start.x, start.y, start.heading]
        given = {name.replace('__', '.'): value for name, value in given.items()}
        self.process: Process | None = None
        if processes is None:
            overrides = [Parameter(name, value=value) for name, value in given.items()]
            self.node = probe.host(FusionNode, parameter_overrides=overrides)
        else:
            self.process = processes.node('fusion_node', 'fusion_node', given)
        self.filtered = probe.listen(Odometry, 'odometry/filtered')
        self.poses = probe.listen(PoseWithCovarianceStamped, 'pose')
        self.innovations = probe.listen(Innovation, 'innovations')
        self.tf = probe.listen(TFMessage, 'tf')
        probe.speak(Odometry, 'odom')
        probe.speak(UwbRange, 'uwb/ranges')
        probe.speak(UwbAnchorArray, 'uwb/anchors')
        probe.speak(PoseWithCovarianceStamped, 'initialpose')
        for topic in ('odom', 'uwb/anchors', 'initialpose'):
            probe.connected(topic)
        if given.get('use_ranges', True):
            probe.connected('uwb/ranges')
        for topic in ('odometry/filtered', 'pose', 'innovations'):
            probe.heard(topic)
        self.stamp = time.time_ns() - 300 * 10**9
        self.truth = START  # base_link in map
        self.odom = Pose2()  # base_link in odom
        self.velocity = (0.0, 0.0)
        self.count = 0
        probe.publish('uwb/anchors', anchors_to_message(ANCHORS, self.stamp, 'map'))
        self.taken('uwb/anchors', 1)

    def taken(self, source: str, count: int) -> None:
        """Wait until the node has used as many messages of a stream."""
        self.probe.wait_diagnostic(
            f'fusion_node: {source}', 'taken', lambda value: int(value) >= count
        )

    def refused(self, source: str, reason: str, count: int = 1) -> None:
        """Wait until a refusal is on /diagnostics."""
        self.probe.wait_diagnostic(f'fusion_node: {source}', f'refused: {reason}', str(count))

    def send_odometry(self, **changes: Any) -> None:
        """Publish the odometry of now."""
        sample = OdometrySample(
            changes.pop('stamp', self.stamp), self.odom, *self.velocity, np.eye(3) * 1e-4
        )
        message = odometry_to_message(sample, changes.pop('frame', 'odom'), 'base_link')
        self.probe.publish('odom', message)

    def send_range(self, anchor: Anchor, **changes: Any) -> None:
        """Publish a range of now, true unless told otherwise."""
        self.count += 1
        sample = RangeSample(
            stamp=changes.pop('stamp', self.stamp),
            anchor_id=changes.pop('anchor_id', anchor.anchor_id),
            tag_id='tag',
            sequence=self.count,
            range_m=changes.pop('range_m', self.distance(anchor)),
            variance_m2=changes.pop('variance_m2', 0.01),
            nlos_probability=changes.pop('nlos_probability', NAN),
        )
        self.probe.publish('uwb/ranges', range_to_message(sample, 'uwb_tag'))

    def distance(self, anchor: Anchor) -> float:
        """Return the true distance between tag and anchor."""
        return math.dist((self.truth.x, self.truth.y, TAG_HEIGHT), anchor.position)

    def send_start(self, pose: Pose2, frame: str = 'map', stamp: int | None = None) -> None:
        """Publish what a user clicks."""
        covariance = np.diag([0.25, 0.25, 0.07])
        sample = PoseSample(self.stamp if stamp is None else stamp, pose, covariance)
        self.probe.publish('initialpose', pose_to_message(sample, frame))

    def drive(
        self,
        speed: float,
        rate: float,
        steps: int,
        ranges: bool = True,
        step_s: float = 0.02,
        **changes: Any,
    ) -> None:
        """Drive for steps, one range (of the anchors in turn) at every second step.

        `changes` are those of the ranges.
        """
        self.velocity = (speed, rate)
        step = Pose2(speed * step_s, 0.0, rate * step_s)
        for index in range(steps):
            self.stamp += round(step_s * 1e9)
            self.truth, self.odom = self.truth @ step, self.odom @ step
            self.send_odometry()
            # Odometry and ranges are two topics, and have no order between them.
            self.probe.spin(0.002)
            if ranges and index % 2 == 0:
                self.send_range(ANCHORS[index // 2 % len(ANCHORS)], **changes)
                self.probe.spin(0.002)

    def settled(self) -> Odometry:
        """Wait until the estimate has reached the stamp of now, and return it."""
        return self.probe.wait_for(
            lambda: next(
                (
                    message
                    for message in reversed(self.filtered)
                    if stamp_from_message(message.header.stamp) == self.stamp
                ),
                None,
            ),
            'an estimate of now',
        )

    def error(self) -> tuple[float, float]:
        """Return the error of the estimate of now: position [m], heading [rad]."""
        pose = self.settled().pose.pose
        heading = heading_from_quaternion(pose.orientation)
        return (
            math.hypot(pose.position.x - self.truth.x, pose.position.y - self.truth.y),
            abs(difference(heading, self.truth.heading)),
        )
