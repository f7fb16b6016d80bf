"""The simulated robots and their room on the ROS side."""

from __future__ import annotations

import sys
from typing import Any

from rclpy.node import Node

from sim_bridge.outlets import RoomOutlets
from sim_bridge.params import BridgeConfig
from sim_bridge.robot_link import RobotLink
from tablerunner.scenario import load_scenario
from tablerunner.simulation import STEP_NS, Team
from tablerunner.types import NANOSECONDS
from tablerunner_ros.clocks import steady_ns, steady_timer
from tablerunner_ros.diagnostics import Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.spin import spin_node

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
        config = self._config
        scenario = load_scenario(config.scenario)
        self._sim = Team(scenario, config.seed, scenario.team(config.robots), config.start_pose)
        self._ticks = 0
        self._reported = (steady_ns(), self._sim.now_ns)
        self._outlets = RoomOutlets(self, config, scenario)
        self._diagnostics = Diagnostics(self, hardware_id='simulation')
        self._diagnostics.describe(self._describe)
        self._links = [
            RobotLink(self, config, robot, self._diagnostics) for robot in self._sim.robots
        ]
        tick_s = STEPS_PER_TICK * STEP_NS / NANOSECONDS
        steady_timer(self, tick_s / config.real_time_factor, self._tick)

    def _tick(self) -> None:
        commands = {link.name: link.command for link in self._links if link.command is not None}
        steps = [self._sim.step(commands)]
        steps += [self._sim.step() for _ in range(1, STEPS_PER_TICK)]
        self._outlets.publish_clock(self._sim.now_ns)
        for link in self._links:
            link.command = None
            link.now_ns = self._sim.now_ns
            link.publish([sample for step in steps for sample in step.samples[link.name]])
        for step in steps:
            if step.image is not None:
                self._outlets.publish_picture(step.image)
        if self._ticks % PEOPLE_EVERY == 0:
            self._outlets.publish_people(self._sim.now_ns, self._sim.people)
        self._ticks += 1

    def _describe(self, report: Report) -> None:
        wall_ns, sim_ns = steady_ns(), self._sim.now_ns
        was_wall_ns, was_sim_ns = self._reported
        self._reported = (wall_ns, sim_ns)
        factor = (sim_ns - was_sim_ns) / max(wall_ns - was_wall_ns, 1)
        report.values['real-time factor'] = f'{factor:.2f}'
        report.values['seed'] = str(self._config.seed)
        for link in self._links:
            link.describe(report)


def main() -> None:
    """Run the node."""
    sys.exit(spin_node(SimBridge))


if __name__ == '__main__':
    main()
