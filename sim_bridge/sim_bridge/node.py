"""The simulated robot and room on the ROS side."""

from __future__ import annotations

import sys
from collections import Counter
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node

from sim_bridge.convert import mounts_to_transforms
from sim_bridge.outlets import Outlets
from sim_bridge.params import BridgeConfig
from tablerunner.scenario import load_scenario
from tablerunner.simulation import STEP_NS, Contact, Simulator
from tablerunner.types import NANOSECONDS, Refusal, Velocity, nanoseconds
from tablerunner_ros.clocks import steady_ns, steady_timer
from tablerunner_ros.conversions.velocity import velocity_from_message
from tablerunner_ros.diagnostics import ERROR, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node
from tablerunner_ros.transforms import StaticTransformBroadcaster

STEPS_PER_TICK = 2
"""The simulation moves by 20 ms at a time: all its sensors' messages of that time leave together,
after one clock message with the newest of their stamps. So no stamp is ahead of the clock, and the
other nodes are woken for the clock 50 times a second, not 100 (in rclpy that is dear)."""

PEOPLE_EVERY = 5
"""Ticks between two messages on people: 10 Hz."""


class SimBridge(Node):
    """Steps the simulation in wall time and passes samples and commands on.

    A tick that comes late is not made up for: the simulated time falls behind the wall clock, and
    never more than one tick is done at once.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('sim_bridge', **options)
        self._config = declare_config(self, BridgeConfig)
        scenario = load_scenario(self._config.scenario)
        self._sim = Simulator(scenario, self._config.seed, self._config.start_pose)
        self._timeout_ns = nanoseconds(scenario.sensors.wheels.command_timeout)
        self._command: Velocity | None = None
        self._ticks = 0
        self._contacts: Counter[str] = Counter()
        self._reported = (steady_ns(), self._sim.now_ns)
        self._outlets = Outlets(self, self._config, scenario)
        self._diagnostics = Diagnostics(self, hardware_id='simulation')
        self._diagnostics.watch('cmd_vel')
        self._diagnostics.describe(self._describe)
        config = self._config
        self._frames = StaticTransformBroadcaster(self)
        self._frames.send(
            *mounts_to_transforms(
                scenario.robot,
                config.base_frame,
                config.imu_frame,
                config.tag_frame,
                self._sim.now_ns,
            )
        )
        type_ = Twist if config.cmd_vel_type == 'twist' else TwistStamped
        profile = qos_for('cmd_vel', subscriber=True)
        self.create_subscription(type_, 'cmd_vel', self._on_command, profile)
        tick_s = STEPS_PER_TICK * STEP_NS / NANOSECONDS
        steady_timer(self, tick_s / config.real_time_factor, self._tick)

    def _on_command(self, message: Twist | TwistStamped) -> None:
        command = velocity_from_message(message)
        if isinstance(command, Velocity) and isinstance(message, TwistStamped):
            stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
            if not 0 <= self._sim.now_ns - stamp <= self._timeout_ns:
                command = Refusal(stamp, 'cmd_vel', '', 'stamp is not of now')
        if isinstance(command, Refusal):
            self._diagnostics.refuse(command)
            return
        self._diagnostics.take('cmd_vel', self._sim.now_ns)
        self._command = command

    def _tick(self) -> None:
        samples = self._sim.step(self._command)
        self._command = None
        for _ in range(1, STEPS_PER_TICK):
            samples += self._sim.step()
        self._outlets.publish_clock(self._sim.now_ns)
        self._outlets.publish_samples(samples)
        for sample in samples:
            if isinstance(sample, Contact):
                self._on_contact(sample)
            elif isinstance(sample, Refusal):
                self._diagnostics.refuse(sample)
        if self._ticks % PEOPLE_EVERY == 0:
            self._outlets.publish_people(self._sim.now_ns, self._sim.people)
        self._ticks += 1

    def _on_contact(self, contact: Contact) -> None:
        self._contacts['at fault' if contact.robot_at_fault else 'not at fault'] += 1
        words = 'hit' if contact.robot_at_fault else 'was touched by'
        self.get_logger().error(f'the robot {words} {contact.name}')

    def _describe(self, report: Report) -> None:
        wall_ns, sim_ns = steady_ns(), self._sim.now_ns
        was_wall_ns, was_sim_ns = self._reported
        self._reported = (wall_ns, sim_ns)
        factor = (sim_ns - was_sim_ns) / max(wall_ns - was_wall_ns, 1)
        if self._contacts['at fault']:
            report.add(ERROR, 'the robot has hit something or someone')
        report.values['contacts at fault'] = str(self._contacts['at fault'])
        report.values['contacts not at fault'] = str(self._contacts['not at fault'])
        report.values['real-time factor'] = f'{factor:.2f}'
        report.values['seed'] = str(self._config.seed)
        report.values['command stale'] = str(self._sim.drive.is_stale(sim_ns)).lower()
        for anchor_id, lost in self._sim.radio.lost.items():
            report.values[f'exchanges lost: {anchor_id}'] = str(lost)


def main() -> None:
    """Run the node."""
    sys.exit(spin_node(SimBridge))


if __name__ == '__main__':
    main()
