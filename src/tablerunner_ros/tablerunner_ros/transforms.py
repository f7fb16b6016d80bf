"""Broadcasting of planar transforms on tf and tf_static.

tf2_ros is not among the pip wheels of ROS; what a broadcaster needs of it is one message. The
topic names are relative, so that a robot in a namespace has a tree of its own.
"""

from __future__ import annotations

import math

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from tablerunner.geometry.frame_tree import Link
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.rotation import quaternion_of_rotation
from tablerunner_ros.conversions.stamp import fill_stamp
from tablerunner_ros.qos import qos_for


def transform_message(stamp: int, parent: str, child: str, pose: Pose2) -> TransformStamped:
    """Return the transform whose `pose` is `child` in `parent`."""
    message = TransformStamped()
    message.header.frame_id = parent
    message.child_frame_id = child
    fill_transform(message, stamp, pose)
    return message


def fill_transform(message: TransformStamped, stamp: int, pose: Pose2) -> None:
    """Write stamp [ns] and a pose in the plane into a transform that has its frames already."""
    fill_stamp(message.header.stamp, stamp)
    transform = message.transform
    transform.translation.x = pose.x
    transform.translation.y = pose.y
    transform.rotation.z = math.sin(0.5 * pose.heading)
    transform.rotation.w = math.cos(0.5 * pose.heading)


def link_to_message(link: Link, stamp: int = 0) -> TransformStamped:
    """Return one frame in its parent as a message."""
    message = TransformStamped()
    message.header.frame_id = link.parent
    message.child_frame_id = link.child
    fill_stamp(message.header.stamp, stamp)
    transform = message.transform
    place, turn = transform.translation, transform.rotation
    place.x, place.y, place.z = link.translation
    turn.x, turn.y, turn.z, turn.w = quaternion_of_rotation(link.rotation)
    return message


class TransformBroadcaster:
    """Publishes one moving transform; its message is made once and filled each time."""

    def __init__(self, node: Node, parent: str, child: str) -> None:
        self._publisher = node.create_publisher(TFMessage, 'tf', qos_for('tf'))
        self._transform = transform_message(0, parent, child, Pose2())
        self._message = TFMessage(transforms=[self._transform])

    def send(self, stamp: int, pose: Pose2) -> None:
        """Publish the pose of the child frame in its parent at a stamp [ns]."""
        fill_transform(self._transform, stamp, pose)
        self._publisher.publish(self._message)


class StaticTransformBroadcaster:
    """Publishes transforms that never change, latched, all in one message."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(TFMessage, 'tf_static', qos_for('tf_static'))
        self._transforms: dict[str, TransformStamped] = {}

    def send(self, *transforms: TransformStamped) -> None:
        """Publish these and all sent before: a latched topic keeps one message per publisher."""
        for transform in transforms:
            self._transforms[transform.child_frame_id] = transform
        self._publisher.publish(TFMessage(transforms=list(self._transforms.values())))
