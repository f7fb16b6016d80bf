"""The node odom_node: wheel encoders and IMU to odometry and the transform odom to base_link."""

from __future__ import annotations

from typing import Any

from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

from odom_node.imu_mount import ImuMount
from odom_node.params import OdomNodeConfig
from tablerunner.messages.wheels import OTHER_JOINTS
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.types import Refusal
from tablerunner_ros.conversions.imu import imu_from_message
from tablerunner_ros.conversions.odometry import fill_odometry
from tablerunner_ros.conversions.wheels import wheels_from_message
from tablerunner_ros.diagnostics import Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node
from tablerunner_ros.stamps import FUTURE, StampCheck, StampConfig
from tablerunner_ros.transforms import TransformBroadcaster

WHEELS, IMU = 'joint_states', 'imu/data'


class OdomNode(Node):
    """Publishes odometry once for each encoder message that is accepted."""

    def __init__(self, **options: Any) -> None:
        super().__init__('odom_node', **options)
        self._config = config = declare_config(self, OdomNodeConfig)
        self._stamps = StampCheck(self, declare_config(self, StampConfig))
        self._odometer = Odometer(declare_config(self, OdometerConfig, on_change=self._configure))
        self._mount = ImuMount(self, config)
        self._message = Odometry()
        self._message.header.frame_id = config.odom_frame
        self._message.child_frame_id = config.base_frame
        self._odom = self.create_publisher(Odometry, 'odom', qos_for('odom'))
        self._tf = (
            TransformBroadcaster(self, config.odom_frame, config.base_frame)
            if config.publish_tf
            else None
        )
        self._diagnostics = Diagnostics(self)
        self._diagnostics.watch(WHEELS, config.silence)
        self._diagnostics.watch(IMU, config.silence)
        self._diagnostics.describe(self._describe)
        self.create_subscription(
            JointState, WHEELS, self._on_wheels, qos_for(WHEELS, subscriber=True)
        )
        self.create_subscription(Imu, IMU, self._on_imu, qos_for(IMU, subscriber=True))

    def _on_wheels(self, message: JointState) -> None:
        config = self._config
        sample = wheels_from_message(message, config.left_joints, config.right_joints)
        if isinstance(sample, Refusal):
            # An arm, too, may publish its joints here: no fault while the wheels come as well.
            self._diagnostics.refuse(sample, expected=sample.reason == OTHER_JOINTS)
            return
        if self._stamps.is_future(sample.stamp):
            self._diagnostics.refuse(Refusal(sample.stamp, WHEELS, '', FUTURE))
            return
        result = self._odometer.add_wheels(sample)
        if isinstance(result, Refusal):
            self._diagnostics.refuse(result)
            return
        fill_odometry(self._message, result)
        self._odom.publish(self._message)
        if self._tf is not None:
            self._tf.send(result.stamp, result.pose)
        self._diagnostics.take(WHEELS, result.stamp)
        if self._odometer.fell_back:
            self._diagnostics.refuse(
                Refusal(result.stamp, IMU, '', 'imu silent: heading from the wheels')
            )
        if self._odometer.slipping:
            # Used all the same, with a doubt that its covariance carries on.
            self._diagnostics.refuse(
                Refusal(result.stamp, WHEELS, '', 'wheels slip: distance doubted'), expected=True
            )

    def _on_imu(self, message: Imu) -> None:
        mount = self._mount.of(message)
        sample = mount if isinstance(mount, Refusal) else imu_from_message(message, mount=mount)
        if isinstance(sample, Refusal):
            self._diagnostics.refuse(sample)
            return
        if self._stamps.is_future(sample.stamp):
            self._diagnostics.refuse(Refusal(sample.stamp, IMU, '', FUTURE))
            return
        refusal = self._odometer.add_imu(sample)
        if refusal is None:
            self._diagnostics.take(IMU, sample.stamp)
        else:
            self._diagnostics.refuse(refusal)

    def _configure(self, config: OdometerConfig) -> None:
        self._odometer.configure(config)

    def _describe(self, report: Report) -> None:
        report.values['heading source'] = self._odometer.config.heading_source
        report.values['gyro bias [rad/s]'] = f'{self._odometer.gyro_bias:.6f}'
        report.values['slips'] = str(self._odometer.slips)
        delay, deviation = self._odometer.imu_delay
        report.values['delay of IMU stamps [s]'] = f'{delay:.4f} +- {deviation:.4f}'


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(OdomNode)
