"""The topics of the contract (docs/bags.md): type and quality of service of each.

For bags that are written without ROS, so that a player offers what a node expects. The nodes' own
profiles are in ``tablerunner_ros``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Quality(Enum):
    """Quality of service of a topic: (reliable, transient local, depth)."""

    SENSOR = (False, False, 5)
    RELIABLE_1 = (True, False, 1)
    RELIABLE_10 = (True, False, 10)
    RELIABLE_50 = (True, False, 50)
    RELIABLE_100 = (True, False, 100)
    LATCHED_1 = (True, True, 1)

    @property
    def reliable(self) -> bool:
        """Whether lost messages are sent again."""
        return self.value[0]

    @property
    def transient_local(self) -> bool:
        """Whether late subscribers get what was published before."""
        return self.value[1]

    @property
    def depth(self) -> int:
        """Number of messages kept."""
        return self.value[2]


@dataclass(frozen=True, slots=True)
class TopicContract:
    """Type and quality of service of one topic."""

    msgtype: str
    quality: Quality


_OWN = 'tablerunner_interfaces/msg'
_POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
_ULTRASONIC = ('left', 'left_front', 'front', 'right_front', 'right')

CONTRACT: dict[str, TopicContract] = {
    'clock': TopicContract('rosgraph_msgs/msg/Clock', Quality.RELIABLE_1),
    'uwb/exchanges': TopicContract(f'{_OWN}/UwbExchange', Quality.SENSOR),
    'uwb/ranges': TopicContract(f'{_OWN}/UwbRange', Quality.SENSOR),
    'uwb/anchors': TopicContract(f'{_OWN}/UwbAnchorArray', Quality.LATCHED_1),
    'uwb/pose': TopicContract(_POSE, Quality.RELIABLE_10),
    'joint_states': TopicContract('sensor_msgs/msg/JointState', Quality.SENSOR),
    'imu/data': TopicContract('sensor_msgs/msg/Imu', Quality.SENSOR),
    'imu/mag': TopicContract('sensor_msgs/msg/MagneticField', Quality.SENSOR),
    **{
        f'ultrasonic/{name}': TopicContract('sensor_msgs/msg/Range', Quality.SENSOR)
        for name in _ULTRASONIC
    },
    'camera/pose': TopicContract(_POSE, Quality.RELIABLE_10),
    'odom': TopicContract('nav_msgs/msg/Odometry', Quality.RELIABLE_10),
    'odometry/filtered': TopicContract('nav_msgs/msg/Odometry', Quality.RELIABLE_10),
    'pose': TopicContract(_POSE, Quality.RELIABLE_10),
    'innovations': TopicContract(f'{_OWN}/Innovation', Quality.RELIABLE_50),
    'initialpose': TopicContract(_POSE, Quality.RELIABLE_10),
    'goal_pose': TopicContract('geometry_msgs/msg/PoseStamped', Quality.RELIABLE_10),
    'waypoints': TopicContract('nav_msgs/msg/Path', Quality.RELIABLE_10),
    'cmd_vel_nav': TopicContract('geometry_msgs/msg/Twist', Quality.RELIABLE_1),
    'cmd_vel': TopicContract('geometry_msgs/msg/Twist', Quality.RELIABLE_1),
    'ground_truth': TopicContract('nav_msgs/msg/Odometry', Quality.RELIABLE_10),
    'tf': TopicContract('tf2_msgs/msg/TFMessage', Quality.RELIABLE_100),
    'tf_static': TopicContract('tf2_msgs/msg/TFMessage', Quality.LATCHED_1),
    'diagnostics': TopicContract('diagnostic_msgs/msg/DiagnosticArray', Quality.RELIABLE_10),
}
"""Contract topics that a bag can hold, by relative name."""
