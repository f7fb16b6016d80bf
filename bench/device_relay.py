"""A node that publishes ranges for each read of a port, unread: what any node costs.

Arguments: PORT RANGES.
"""

from __future__ import annotations

import sys

import rclpy
import serial
from rclpy.node import Node

from tablerunner_interfaces.msg import UwbRange
from tablerunner_ros.qos import qos_for


def main() -> None:
    """Relay until the port goes."""
    path, count = sys.argv[1], int(sys.argv[2])
    rclpy.init(args=[])
    node = Node('device_relay')
    publisher = node.create_publisher(UwbRange, 'uwb/ranges', qos_for('uwb/ranges'))
    message = UwbRange(anchor_id='A0', tag_id='tag7', range=3.0)
    message.header.frame_id = 'uwb_tag'
    port = serial.Serial(path, 921_600)
    while port.read(1):
        port.read(port.in_waiting)
        for _ in range(count):
            publisher.publish(message)


if __name__ == '__main__':
    main()
