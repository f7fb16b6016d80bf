"""What the launcher knows of a running robot: who is up, where it is, what it touched."""

from __future__ import annotations

import math
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_srvs.srv import Trigger

from tablerunner.geometry.pose import Pose2
from tablerunner.types import NANOSECONDS
from tablerunner_bringup.polling import Newest, never_called, take_all
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.qos import qos_for

STANDING_M_S = 0.02
STANDING_RAD_S = 0.05


@dataclass(frozen=True)
class Movement:
    """Pose in map and velocity at one stamp, estimated or true."""

    stamp: int
    pose: Pose2
    linear_m_s: float
    angular_rad_s: float

    @property
    def stands(self) -> bool:
        """Whether the robot does not move to speak of."""
        return abs(self.linear_m_s) < STANDING_M_S and abs(self.angular_rad_s) < STANDING_RAD_S

    def at(self, stamp: int) -> Pose2:
        """Return the pose at a nearby stamp, by the velocity."""
        dt_s = (stamp - self.stamp) / NANOSECONDS
        return self.pose @ Pose2(self.linear_m_s * dt_s, 0.0, self.angular_rad_s * dt_s)


@dataclass(frozen=True)
class Touch:
    """Something the simulated robot touched or was touched by."""

    words: str
    kind: str
    robot_at_fault: bool


class Monitor:
    """Polls the topics of one robot; `poll` at whatever pace the news is wanted."""

    def __init__(self, node: Node, odom_topic: str = 'odom') -> None:
        self._node = node
        self._estimate = Newest(
            node, Odometry, 'odometry/filtered', qos_for('odometry/filtered', subscriber=True)
        )
        self._truth = Newest(node, Odometry, 'ground_truth', qos_for('ground_truth'))
        self._odom = Newest(node, Odometry, odom_topic, qos_for('odom'))
        self._diagnostics = node.create_subscription(
            DiagnosticArray,
            'diagnostics',
            never_called,
            qos_for('diagnostics', subscriber=True),
        )
        self._contacts = node.create_subscription(
            DiagnosticStatus, 'contacts', never_called, qos_for('contacts', subscriber=True)
        )
        self._safety = Newest(
            node, DiagnosticStatus, 'safety_state', qos_for('safety_state', subscriber=True)
        )
        self._emergency_stop = node.create_client(Trigger, 'emergency_stop')
        self._release = node.create_client(Trigger, 'release')
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.touches: list[Touch] = []

    def poll(self) -> None:
        """Take what has come since the last call."""
        for newest in (self._estimate, self._truth, self._odom, self._safety):
            newest.poll()
        for array, _ in take_all(self._diagnostics):
            self.statuses.update({status.name: status for status in array.status})
        for status, _ in take_all(self._contacts):
            values = {item.key: item.value for item in status.values}
            self.touches.append(
                Touch(
                    status.message,
                    values.get('kind', ''),
                    status.level == DiagnosticStatus.ERROR,
                )
            )

    def stop_robot(self) -> None:
        """Tell the safety stop to brake and to hold; nothing happens when it is not there."""
        if self._emergency_stop.service_is_ready():
            self._emergency_stop.call_async(Trigger.Request())

    def release_robot(self) -> None:
        """Tell the safety stop to end an emergency stop."""
        if self._release.service_is_ready():
            self._release.call_async(Trigger.Request())

    @property
    def emergency(self) -> bool:
        """Whether the safety stop says that it holds the robot for an emergency."""
        status = self._safety.message
        values = {} if status is None else {item.key: item.value for item in status.values}
        return values.get('emergency') == 'true'

    @property
    def estimate(self) -> Movement | None:
        """Where the robot believes it is."""
        return _movement(self._estimate.message)

    @property
    def truth(self) -> Movement | None:
        """Where it is, when it is simulated."""
        return _movement(self._truth.message)

    @property
    def base(self) -> Movement | None:
        """How it moves: by the truth, or by its odometry when there is no truth."""
        return self.truth or _movement(self._odom.message)

    @property
    def error_m(self) -> float:
        """Distance from estimate to truth at the estimate's stamp; NaN while either is unknown."""
        estimate, truth = self.estimate, self.truth
        if estimate is None or truth is None:
            return math.nan
        return estimate.pose.distance_to(truth.at(estimate.stamp))

    def is_up(self, name: str) -> bool:
        """Return whether a node is on the graph and has reported on diagnostics."""
        return name in self._node.get_node_names() and name in self.statuses


def _movement(message: Odometry | None) -> Movement | None:
    if message is None:
        return None
    stamp = message.header.stamp
    pose = message.pose.pose
    return Movement(
        stamp.sec * NANOSECONDS + stamp.nanosec,
        Pose2(pose.position.x, pose.position.y, heading_from_quaternion(pose.orientation)),
        message.twist.twist.linear.x,
        message.twist.twist.angular.z,
    )
