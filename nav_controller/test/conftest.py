"""Fixtures for tests over DDS: a room, and a robot in it that is all but real."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range

from tablerunner.geometry.pose import Pose2
from tablerunner_ros.conversions.quaternion import fill_quaternion
from tablerunner_ros.testing.fixtures import domain, probe, processes, quick_diagnostics
from tablerunner_ros.testing.probe import Probe

__all__ = ['domain', 'probe', 'processes', 'quick_diagnostics']

ROOM = """\
name: room
walls:
  - {name: hull, closed: true, points: [[0, 0], [5, 0], [5, 4], [0, 4]]}
boxes:
  - {name: block, x: 2.5, y: 3.4, length: 0.6, width: 0.6}
kitchen: {stop: [1.0, 1.0, 0.0]}
tables:
  - {name: table_1, x: 2.6, y: 0.4, length: 0.4, width: 0.4, stop: [1.9, 1.0, 0.0]}
  - {name: table_2, x: 4.6, y: 3.6, length: 0.4, width: 0.4, stop: [4.0, 3.0, 0.0]}
"""
SENSORS = ('left', 'left_front', 'front', 'right_front', 'right')
PERIOD_S = 0.05


class Robot:
    """Feeds the nodes under test with pose and ultrasonics and drives as it is told.

    Attributes
    ----------
    pose : Pose2
        base_link in map; follows ``cmd_vel`` or ``cmd_vel_nav``, whichever `follow` names.
    ranges : dict of str to float
        What each sensor reads [m]; one that is taken out falls silent.
    """

    def __init__(self, probe: Probe, follow: str = '') -> None:
        self.probe = probe
        self.pose = Pose2(1.0, 1.0, 0.0)
        self.ranges = dict.fromkeys(SENSORS, math.inf)
        self.position_variance, self.heading_variance = 0.0025, 0.0025
        self.localised = True
        self.frame = 'map'
        self.velocity = Twist()
        if follow:
            probe.node.create_subscription(Twist, follow, self._on_velocity, 1)
        for name in SENSORS:
            probe.speak(Range, f'ultrasonic/{name}')
        probe.speak(Odometry, 'odometry/filtered')
        self.timer = probe.node.create_timer(PERIOD_S, self.tick)

    def _on_velocity(self, message: Twist) -> None:
        self.velocity = message

    def tick(self) -> None:
        """Move on by one period and publish what the sensors of a robot would."""
        linear, turn = self.velocity.linear.x * PERIOD_S, self.velocity.angular.z * PERIOD_S
        step = Pose2(linear * math.cos(turn / 2), linear * math.sin(turn / 2), turn)
        self.pose = self.pose @ step
        for name, distance in self.ranges.items():
            self.publish_range(name, distance)
        if self.localised:
            self.publish_pose()

    def publish_pose(self) -> None:
        """Publish where the robot is."""
        message = Odometry()
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.header.frame_id = self.frame
        message.child_frame_id = 'base_link'
        message.pose.pose.position.x = self.pose.x
        message.pose.pose.position.y = self.pose.y
        fill_quaternion(message.pose.pose.orientation, self.pose.heading)
        message.pose.covariance[0] = message.pose.covariance[7] = self.position_variance
        message.pose.covariance[35] = self.heading_variance
        message.twist.twist = self.velocity
        self.probe.publish('odometry/filtered', message)

    def publish_range(self, name: str, distance: float) -> None:
        """Publish one reading."""
        message = Range(
            radiation_type=Range.ULTRASOUND,
            field_of_view=0.48,
            min_range=0.03,
            max_range=3.0,
            range=distance,
        )
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.header.frame_id = f'ultrasonic_{name}'
        self.probe.publish(f'ultrasonic/{name}', message)


@pytest.fixture(autouse=True)
def _quick(quick_diagnostics: None) -> None:
    """Report often, in every test of these nodes."""


@pytest.fixture
def make_robot(probe: Probe) -> Callable[..., Robot]:
    """Return a maker of robots."""
    return lambda follow='': Robot(probe, follow)


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """Return a scenario file of a small room with two tables."""
    path = tmp_path / 'room.yaml'
    path.write_text(ROOM, encoding='utf-8')
    return path


def words(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status."""
    return {item.key: item.value for item in status.values}
