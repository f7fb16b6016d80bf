"""fusion_node with the odometry of diff_drive_controller in the place of odom_node's, over DDS."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile

from fusion_node.testing import Fusion
from tablerunner.types import OdometrySample
from tablerunner_ros.conversions.odometry import odometry_to_message
from tablerunner_ros.testing.probe import Probe


class Controlled(Fusion):
    """Its odometry comes as the controller fills it: diagonal covariances, from its parameters."""

    pose_diagonal = twist_diagonal = (0.0,) * 6

    def send_odometry(self, **_changes: Any) -> None:
        """Publish as diff_drive_controller: SystemDefaultsQoS, frames odom and base_link."""
        sample = OdometrySample(
            self.stamp, self.odom, *self.velocity, np.zeros((3, 3)), np.zeros((2, 2))
        )
        message = odometry_to_message(sample, 'odom', 'base_link')
        message.pose.covariance = np.diag(self.pose_diagonal).ravel()
        message.twist.covariance = np.diag(self.twist_diagonal).ravel()
        if not hasattr(self, 'publisher'):
            node = self.probe.node
            self.publisher = node.create_publisher(Odometry, 'odom', QoSProfile(depth=10))
            self.probe.wait_for(self.publisher.get_subscription_count, 'the node')
        self.publisher.publish(message)


@pytest.mark.parametrize(
    'diagonal',
    [(0.0,) * 6, (0.001, 0.001, 0.001, 0.001, 0.001, 0.01)],
    ids=['defaults', 'of its documentation'],
)
def test_fusion_takes_the_odometry_of_a_controller(
    probe: Probe, diagonal: tuple[float, ...]
) -> None:
    """Covariances of zero say nothing: the pose is no more certain for them, and is tracked."""
    robot = Controlled(probe)
    robot.pose_diagonal = robot.twist_diagonal = diagonal
    robot.drive(0.5, 0.3, 200)
    distance, turned = robot.error()
    # True ranges with a told deviation of 0.1 m, from the right start.
    assert distance < 0.05
    assert turned < 0.05
    covariance = robot.settled().pose.covariance
    assert 1e-5 < covariance[0] < 0.04
    robot.taken('odom', 200)
