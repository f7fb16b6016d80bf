"""The table of QoS profiles against the contract."""

from __future__ import annotations

import pytest
from rclpy.qos import DurabilityPolicy, QoSCompatibility, ReliabilityPolicy, qos_check_compatible

from tablerunner_ros.qos import TOPICS, qos_for


@pytest.mark.parametrize('topic', TOPICS)
def test_qos_publisher_and_subscriber_are_compatible(topic: str) -> None:
    """Whoever takes both from the table is connected."""
    topic = topic.replace('*', 'front')
    verdict, reason = qos_check_compatible(qos_for(topic), qos_for(topic, subscriber=True))
    # A warning remains: liveliness is left to the middleware on both sides.
    assert verdict != QoSCompatibility.ERROR, reason


@pytest.mark.parametrize(
    ('topic', 'reliable', 'depth', 'latched'),
    [
        ('clock', True, 1, False),
        ('uwb/exchanges', False, 5, False),
        ('uwb/ranges', False, 5, False),
        ('uwb/anchors', True, 1, True),
        ('uwb/pose', True, 10, False),
        ('joint_states', False, 5, False),
        ('imu/data', False, 5, False),
        ('imu/mag', False, 5, False),
        ('ultrasonic/left_front', False, 5, False),
        ('camera/image_raw', False, 5, False),
        ('camera/camera_info', False, 5, False),
        ('camera/pose', True, 10, False),
        ('camera/debug_image', False, 5, False),
        ('odom', True, 10, False),
        ('odometry/filtered', True, 10, False),
        ('pose', True, 10, False),
        ('innovations', True, 50, False),
        ('initialpose', True, 10, False),
        ('goal_pose', True, 10, False),
        ('waypoints', True, 10, False),
        ('fusion_state', True, 1, True),
        ('safety_state', True, 1, True),
        ('cmd_vel_nav', True, 1, False),
        ('cmd_vel', True, 1, False),
        ('ground_truth', True, 10, False),
        ('tf', True, 100, False),
        ('tf_static', True, 1, True),
    ],
)
def test_qos_publisher_is_as_in_the_contract(
    topic: str, reliable: bool, depth: int, latched: bool
) -> None:
    """Reliability, depth and durability of each publisher, as the design has them."""
    profile = qos_for(topic)
    assert (profile.reliability == ReliabilityPolicy.RELIABLE) is reliable
    assert (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) is latched
    assert profile.depth == depth


def test_qos_unknown_topic_names_the_known() -> None:
    """A slip in a topic's name is found where it is made."""
    with pytest.raises(KeyError, match='uwb/ranges'):
        qos_for('uwb/range')
    with pytest.raises(KeyError):
        qos_for('ultrasonic/')
