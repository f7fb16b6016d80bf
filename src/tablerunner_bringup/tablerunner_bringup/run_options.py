"""What a run is: the scenario, the seed and the few switches that reach the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class RunOptions(Config):
    """Options that become parameters of nodes; the launcher and the launch file share them."""

    scenario: str = parameter('', description='Scenario file; empty: the restaurant')
    seed: int = parameter(1, description='Seed of everything that is drawn', low=0, high=2**31 - 1)
    namespace: str = parameter('', description='Namespace of all nodes of this robot')
    simulated: bool = parameter(True, description='Whether sim_bridge takes the place of hardware')
    unknown_start: bool = parameter(
        False, description='Whether the robot is not told where it stands at the start'
    )
    real_time_factor: float = parameter(
        1.0, description='Simulated seconds per second', above=0.0, high=100.0
    )
    estimator: str = parameter('ekf', description='Estimator of fusion_node')
    localization_only: bool = parameter(
        False, description='Whether somebody else (Nav2) drives: map to odom and pose, no more'
    )
    odom_topic: str = parameter(
        '', description='Odometry of somebody else, as of diff_drive_controller; empty: odom_node'
    )
    robot_description: bool = parameter(
        False, description='Whether robot_state_publisher tells where the sensors sit'
    )

    @property
    def scenario_path(self) -> Path:
        """The scenario file."""
        return Path(self.scenario)
