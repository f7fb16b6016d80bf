"""A node that answers each reading of the front sensor with a zero: what any node costs."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node
from sensor_msgs.msg import Range

from tablerunner_ros.qos import qos_for


def main() -> None:
    """Answer until interrupted."""
    rclpy.init(args=[])
    node = Node('range_relay')
    publisher = node.create_publisher(Twist, 'cmd_vel', qos_for('cmd_vel'))
    node.create_subscription(
        Range,
        'ultrasonic/front',
        lambda _: publisher.publish(Twist()),
        qos_for('ultrasonic/front', subscriber=True),
    )
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
