"""How the IMU is mounted: by parameters, or by the static transforms of the robot."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from odom_node.params import OdomNodeConfig
from tablerunner.geometry.frame_tree import FrameTree
from tablerunner.geometry.rotation import Rotation, rotation_of_rpy
from tablerunner.messages.transforms import links_from_message
from tablerunner.types import Refusal
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.qos import qos_for

SOURCE = 'imu/data'
STATIC = 'tf_static'


class ImuMount:
    """The rotation of an IMU's vectors into base_link, told by the frame of a message."""

    def __init__(self, node: Node, config: OdomNodeConfig) -> None:
        self._base = config.base_frame
        self._told = rotation_of_rpy(*config.imu_tilt, config.imu_heading)
        self._tree: FrameTree | None = None
        if config.imu_from_tf:
            self._tree = FrameTree()
            profile = qos_for(STATIC, subscriber=True)
            node.create_subscription(TFMessage, STATIC, self._on_static, profile)
        self._found: dict[str, Rotation] = {}

    def of(self, message: Any) -> Rotation | Refusal:
        """Return the rotation for a message of the IMU; a refusal while it is not known."""
        if self._tree is None:
            return self._told
        frame = message.header.frame_id
        found = self._found.get(frame)
        if found is None:
            found = self._tree.rotation(self._base, frame)
            if found is None:
                reason = f'no static transform from {self._base} to its frame'
                return Refusal(stamp_from_message(message.header.stamp), SOURCE, frame, reason)
            self._found[frame] = found
        return found

    def _on_static(self, message: TFMessage) -> None:
        for link in links_from_message(message, STATIC):
            if self._tree is not None and not isinstance(link, Refusal):
                self._tree.add(link)
        self._found.clear()
