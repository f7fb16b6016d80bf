"""One simulated robot on the ROS side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node

from sim_bridge.convert import mounts_to_transforms
from sim_bridge.outlets import RobotOutlets
from sim_bridge.params import BridgeConfig
from tablerunner.simulation import START_NS, Contact, Sample, SimulatedRobot
from tablerunner.types import NANOSECONDS, Refusal, Velocity, nanoseconds
from tablerunner_ros.conversions.velocity import velocity_from_message
from tablerunner_ros.diagnostics import ERROR, Diagnostics, Report
from tablerunner_ros.qos import qos_for
from tablerunner_ros.transforms import StaticTransformBroadcaster


class RobotLink:
    """One simulated robot's side of the bridge: its topics, and the commands that came for it.

    Attributes
    ----------
    name : str
        In the simulation; '' for the only robot.
    command : Velocity or None
        What came since the last tick.
    contacts : Counter
        Touches so far, ``at fault`` and ``not at fault``.
    """

    def __init__(
        self, node: Node, config: BridgeConfig, robot: SimulatedRobot, diagnostics: Diagnostics
    ) -> None:
        self.name = robot.name
        self.robot = robot
        self.command: Velocity | None = None
        self.contacts: Counter[str] = Counter()
        self.prefix = f'{robot.name}/' if robot.name else ''
        self._node = node
        self._timeout_ns = nanoseconds(robot.scenario.sensors.wheels.command_timeout)
        self._outlets = RobotOutlets(node, config, robot.scenario, self.prefix)
        self._topic = f'{self.prefix}cmd_vel'
        self._diagnostics = diagnostics
        diagnostics.watch(self._topic)
        self._frames = StaticTransformBroadcaster(node, self.prefix)
        self._frames.send(
            *mounts_to_transforms(
                robot.scenario.robot,
                config.base_frame,
                config.imu_frame,
                config.tag_frame,
                START_NS,
            )
        )
        type_ = Twist if config.cmd_vel_type == 'twist' else TwistStamped
        profile = qos_for('cmd_vel', subscriber=True)
        node.create_subscription(type_, self._topic, self._on_command, profile)
        self.now_ns = START_NS

    def _on_command(self, message: Twist | TwistStamped) -> None:
        command = velocity_from_message(message)
        if isinstance(command, Velocity) and isinstance(message, TwistStamped):
            stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
            if not 0 <= self.now_ns - stamp <= self._timeout_ns:
                command = Refusal(stamp, 'cmd_vel', '', 'stamp is not of now')
        if isinstance(command, Refusal):
            self._refuse(command)
            return
        self._diagnostics.take(self._topic, self.now_ns)
        self.command = command

    def publish(self, samples: Sequence[Sample]) -> None:
        """Publish what the robot measured in a tick, and note what it touched."""
        self._outlets.publish_samples(samples)
        for sample in samples:
            if isinstance(sample, Contact):
                self._on_contact(sample)
            elif isinstance(sample, Refusal):
                self._refuse(sample)

    def _refuse(self, refusal: Refusal) -> None:
        self._diagnostics.refuse(replace(refusal, source=self._topic))

    def _on_contact(self, contact: Contact) -> None:
        self.contacts['at fault' if contact.robot_at_fault else 'not at fault'] += 1
        words = 'hit' if contact.robot_at_fault else 'was touched by'
        self._node.get_logger().error(f'{self.name or "the robot"} {words} {contact.name}')

    def describe(self, report: Report) -> None:
        """Add what this robot does to the node's status."""
        of = f'{self.name}: ' if self.name else ''
        if self.contacts['at fault']:
            report.add(ERROR, f'{self.name or "the robot"} has hit something or someone')
        report.values[f'{of}contacts at fault'] = str(self.contacts['at fault'])
        report.values[f'{of}contacts not at fault'] = str(self.contacts['not at fault'])
        stale = self.robot.drive.is_stale(self.now_ns)
        report.values[f'{of}command stale'] = str(stale).lower()
        for anchor_id, lost in self.robot.radio.lost.items():
            report.values[f'{of}exchanges lost: {anchor_id}'] = str(lost)
