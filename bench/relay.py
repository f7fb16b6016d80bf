"""A node that only passes a message on: what any two nodes cost. Arguments: IN OUT."""

from __future__ import annotations

import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

from tablerunner_interfaces.msg import UwbExchange


def main() -> None:
    """Relay until interrupted."""
    source, target = sys.argv[1:3]
    rclpy.init(args=[])
    node = Node(f'relay_{target}')
    publisher = node.create_publisher(UwbExchange, target, qos_profile_sensor_data)
    node.create_subscription(UwbExchange, source, publisher.publish, qos_profile_sensor_data)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
