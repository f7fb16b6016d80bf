"""A robot in real time behind the topics of its drivers."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState, Range

from sim_bridge.convert import truth_to_message
from tablerunner.scenario import Scenario
from tablerunner.simulation import STEP_NS, Contact, Simulator, Truth
from tablerunner.types import (
    ExchangeSample,
    ImuSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
    seconds,
)
from tablerunner.uwb.ranging import distance, double_sided, intervals
from tablerunner_bringup.emulator.dwm1001 import Dwm1001
from tablerunner_bringup.polling import never_called, take_all
from tablerunner_interfaces.msg import UwbExchange
from tablerunner_ros.conversions.exchange import exchange_to_message
from tablerunner_ros.conversions.imu import imu_to_message
from tablerunner_ros.conversions.ultrasonic import ultrasonic_to_message
from tablerunner_ros.conversions.velocity import velocity_from_message
from tablerunner_ros.conversions.wheels import wheels_to_message
from tablerunner_ros.qos import qos_for

LEFT_JOINT, RIGHT_JOINT = 'left_wheel_joint', 'right_wheel_joint'
DRIVER = QoSProfile(depth=10)
"""Reliable: SystemDefaultsQoS, as the broadcasters of ros2_control have it."""

FIRST_ADDRESS = 0xDA00
MOST_STEPS = 20
"""Steps that a late call makes up for; what is later is lost time of the emulated robot."""


def address_of(anchor_id: str, index: int) -> str:
    """Return the address by which a module knows an anchor: its name, if that is one."""
    name = anchor_id.upper()
    if len(name) == 4 and all(letter in '0123456789ABCDEF' for letter in name):
        return name
    return f'{FIRST_ADDRESS + index:04X}'


@dataclass
class Told:
    """What the robot has done so far, for the terminal; `lost_s` is real time not kept up with."""

    touches: int = 0
    commands: int = 0
    refused: int = 0
    lost_s: float = 0.0


class EmulatedRobot:
    """Steps a simulated robot with the wall clock and speaks as its drivers would.

    Parameters
    ----------
    node : rclpy.node.Node
        In no executor.
    scenario : Scenario
    seed : int
    stamped : bool
        Whether the base takes TwistStamped.
    module : Dwm1001, optional
        Is told the ranges; without it they go out on uwb/exchanges.
    """

    def __init__(
        self,
        node: Node,
        scenario: Scenario,
        seed: int,
        stamped: bool = False,
        module: Dwm1001 | None = None,
    ) -> None:
        self.told = Told()
        self._sim = Simulator(scenario, seed)
        self._addresses = {
            anchor.id: address_of(anchor.id, index)
            for index, anchor in enumerate(scenario.anchors)
        }
        self._module = module
        self._offset_ns = time.time_ns() - self._sim.now_ns
        self._joints = node.create_publisher(JointState, 'joint_states', DRIVER)
        self._imu = node.create_publisher(Imu, 'imu/data', DRIVER)
        self._truth = node.create_publisher(Odometry, 'ground_truth', qos_for('ground_truth'))
        self._sonars = {
            mount.frame: node.create_publisher(
                Range, f'ultrasonic/{mount.name}', qos_for('ultrasonic/front')
            )
            for mount in scenario.robot.ultrasonics
        }
        self._exchanges = (
            node.create_publisher(UwbExchange, 'uwb/exchanges', qos_for('uwb/exchanges'))
            if module is None
            else None
        )
        self._commands = node.create_subscription(
            TwistStamped if stamped else Twist,
            'cmd_vel',
            never_called,
            qos_for('cmd_vel', subscriber=True),
        )

    @property
    def truth(self) -> Truth:
        """Where the robot really is."""
        return self._sim.truth

    def advance(self) -> None:
        """Catch up with the wall clock."""
        command = self._newest_command()
        due = (time.time_ns() - self._offset_ns - self._sim.now_ns) // STEP_NS
        if due > MOST_STEPS:
            self._offset_ns += (due - MOST_STEPS) * STEP_NS
            self.told.lost_s += seconds((due - MOST_STEPS) * STEP_NS)
        for _ in range(min(due, MOST_STEPS)):
            for sample in self._sim.step(command):
                self._publish(sample)
            command = None

    def _newest_command(self) -> Velocity | None:
        newest = None
        for message, _ in take_all(self._commands):
            command = velocity_from_message(message)
            if isinstance(command, Refusal):
                self.told.refused += 1
                continue
            self.told.commands += 1
            newest = command
        return newest

    def _publish(self, sample: Any) -> None:
        if isinstance(sample, Contact):
            self.told.touches += 1
            return
        if not hasattr(sample, 'stamp'):
            return
        stamp = sample.stamp + self._offset_ns
        if isinstance(sample, WheelSample):
            moved = replace(sample, stamp=stamp)
            self._joints.publish(wheels_to_message(moved, LEFT_JOINT, RIGHT_JOINT))
        elif isinstance(sample, ImuSample):
            # A gyroscope: no orientation.
            moved_imu = replace(sample, stamp=stamp, yaw_rad=float('nan'))
            self._imu.publish(imu_to_message(moved_imu, 'imu_link'))
        elif isinstance(sample, UltrasonicSample):
            moved_sonar = replace(sample, stamp=stamp)
            self._sonars[sample.sensor].publish(ultrasonic_to_message(moved_sonar))
        elif isinstance(sample, ExchangeSample):
            self._range(sample, stamp)
        elif isinstance(sample, Truth):
            moved_truth = replace(sample, stamp=stamp)
            self._truth.publish(truth_to_message(moved_truth, 'map', 'base_link'))

    def _range(self, sample: ExchangeSample, stamp: int) -> None:
        if self._exchanges is not None:
            message = exchange_to_message(replace(sample, stamp=stamp), 'uwb_tag')
            self._exchanges.publish(message)
        elif self._module is not None and sample.anchor_id in self._addresses:
            spans = intervals(
                sample.poll_tx,
                sample.poll_rx,
                sample.response_tx,
                sample.response_rx,
                sample.final_tx,
                sample.final_rx,
            )
            range_m = float(distance(double_sided(*spans)))
            self._module.measure(self._addresses[sample.anchor_id], range_m, time.monotonic())
