"""Pictures between processes: none is lost."""

from __future__ import annotations

import os
import subprocess
import sys

from tablerunner_bringup.large_messages import PROFILES, allow_large_messages

LISTENER = """\
import rclpy
from sensor_msgs.msg import Image
from tablerunner_ros.qos import qos_for

rclpy.init()
node, seen = rclpy.create_node('listener'), []
profile = qos_for('camera/image_raw', subscriber=True)
node.create_subscription(Image, 'camera/image_raw', seen.append, profile)
while len(seen) < 20:
    rclpy.spin_once(node, timeout_sec=1.0)
print(len(seen), flush=True)
"""
SPEAKER = """\
import time
from array import array
import rclpy
from sensor_msgs.msg import Image
from tablerunner_ros.qos import qos_for

rclpy.init()
node = rclpy.create_node('speaker')
publisher = node.create_publisher(Image, 'camera/image_raw', qos_for('camera/image_raw'))
while not publisher.get_subscription_count():
    time.sleep(0.05)
time.sleep(0.5)
picture = Image(height=480, width=640, step=1920, encoding='bgr8', data=array('B', bytes(921600)))
for _ in range(22):
    publisher.publish(picture)
    time.sleep(0.05)
time.sleep(2.0)
"""


def test_pictures_between_processes_arrive(domain: int) -> None:
    """Twenty of twenty-two of 0.9 MB; by the defaults of Fast DDS it is about five."""
    environment = {
        **os.environ,
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }
    environment.pop(PROFILES, None)
    allow_large_messages(environment)
    processes = [
        subprocess.Popen([sys.executable, '-c', code], env=environment, stdout=subprocess.PIPE)
        for code in (LISTENER, SPEAKER)
    ]
    try:
        assert processes[0].communicate(timeout=40)[0] == b'20\n'
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_settings_of_a_user_are_kept() -> None:
    environment = {PROFILES: 'mine.xml'}
    allow_large_messages(environment)
    assert environment == {PROFILES: 'mine.xml'}
