"""The quality of service of every topic of the contract, in one table.

The table holds what publishers offer. Subscribers ask for the same, only with a queue of their
own length: a best-effort queue of five lasts 50 ms of an IMU at 100 Hz, and a process that is not
scheduled for that long must not lose data for it.
"""

from __future__ import annotations

from typing import NamedTuple

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

SENSOR_DEPTH = 5
"""Queue of a sensor's publisher, as in SensorDataQoS."""


class TopicQos(NamedTuple):
    """Reliability, durability and both queue lengths of one topic."""

    reliable: bool
    depth: int  # of the publisher
    subscriber_depth: int
    latched: bool = False  # transient local: a late subscriber gets the last message

    def publisher(self) -> QoSProfile:
        """Return the profile that a publisher offers."""
        return self._profile(self.depth)

    def subscriber(self) -> QoSProfile:
        """Return the profile that a subscriber asks for."""
        return self._profile(self.subscriber_depth)

    def _profile(self, depth: int) -> QoSProfile:
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=depth,
            reliability=(
                ReliabilityPolicy.RELIABLE if self.reliable else ReliabilityPolicy.BEST_EFFORT
            ),
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
            ),
        )


_SENSOR = TopicQos(reliable=False, depth=SENSOR_DEPTH, subscriber_depth=50)
_RELIABLE_1 = TopicQos(reliable=True, depth=1, subscriber_depth=1)
_RELIABLE_10 = TopicQos(reliable=True, depth=10, subscriber_depth=10)

TOPICS: dict[str, TopicQos] = {
    'clock': _RELIABLE_1,
    'uwb/exchanges': _SENSOR,
    'uwb/ranges': _SENSOR,
    'uwb/anchors': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'uwb/pose': _RELIABLE_10,
    'person/exchanges': _SENSOR,
    'person/ranges': _SENSOR,
    'person/anchors': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'person/pose': _RELIABLE_10,
    'joint_states': _SENSOR,
    'imu/data': _SENSOR,
    'imu/mag': _SENSOR,
    'ultrasonic/*': _SENSOR,
    'camera/image_raw': _SENSOR,
    'camera/camera_info': _SENSOR,
    'camera/pose': _RELIABLE_10,
    'camera/debug_image': _SENSOR,
    'odom': _RELIABLE_10,
    'odometry/filtered': _RELIABLE_10,
    'pose': _RELIABLE_10,
    'innovations': TopicQos(reliable=True, depth=50, subscriber_depth=50),
    'initialpose': _RELIABLE_10,
    'goal_pose': _RELIABLE_10,
    'waypoints': _RELIABLE_10,
    'plan': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'fusion_state': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'battery_state': _SENSOR,
    'safety_state': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'follow_state': TopicQos(reliable=True, depth=1, subscriber_depth=1, latched=True),
    'fuzzy_trace': _RELIABLE_10,
    'cmd_vel_nav': _RELIABLE_1,
    'cmd_vel': _RELIABLE_1,
    'ground_truth': _RELIABLE_10,
    'people': _RELIABLE_10,
    # Who comes late must hear of every touch: a demo fails on one.
    'contacts': TopicQos(reliable=True, depth=50, subscriber_depth=50, latched=True),
    'tf': TopicQos(reliable=True, depth=100, subscriber_depth=100),
    'tf_static': TopicQos(reliable=True, depth=1, subscriber_depth=100, latched=True),
    'diagnostics': TopicQos(reliable=True, depth=10, subscriber_depth=50),
}
"""Every topic of the contract by its relative name; a star stands for one or more parts."""


def topic_qos(topic: str) -> TopicQos:
    """Return the entry of a topic, given by its relative name.

    Raises
    ------
    KeyError
        The contract has no such topic.
    """
    entry = TOPICS.get(topic)
    if entry is not None:
        return entry
    for name, starred in TOPICS.items():
        if name.endswith('/*') and topic.startswith(name[:-1]) and len(topic) >= len(name):
            return starred
    raise KeyError(f'no topic {topic!r} in the contract; known are {", ".join(TOPICS)}')


def qos_for(topic: str, *, subscriber: bool = False) -> QoSProfile:
    """Return the profile for publishing on a topic of the contract, or for subscribing to it."""
    entry = topic_qos(topic)
    return entry.subscriber() if subscriber else entry.publisher()
