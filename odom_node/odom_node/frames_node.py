"""The node sensor_frames: where the sensors sit, from parameters, as static transforms.

For robots without a URDF: where robot_state_publisher runs, this node is not needed.
"""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from odom_node.frames_params import SensorFramesConfig
from tablerunner_ros.diagnostics import Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.spin import spin_node
from tablerunner_ros.transforms import StaticTransformBroadcaster, link_to_message


class FramesNode(Node):
    """Publishes its transforms once, latched."""

    def __init__(self, **options: Any) -> None:
        super().__init__('sensor_frames', **options)
        config = declare_config(self, SensorFramesConfig)
        self._frames = config.frames
        self._broadcaster = StaticTransformBroadcaster(self)
        self._broadcaster.send(*(link_to_message(link) for link in config.links))
        self._diagnostics = Diagnostics(self)
        self._diagnostics.describe(self._describe)

    def _describe(self, report: Report) -> None:
        report.values['frames'] = ', '.join(self._frames)


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(FramesNode)
