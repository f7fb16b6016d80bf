"""`launch --localization-only` in AMCL's place: what Nav2 and RViz see of it, over DDS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from tablerunner.geometry.frame_tree import FrameTree, Link
from tablerunner.messages.transforms import links_from_message
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.testing.probe import Probe

pytestmark = pytest.mark.slow

UP_LIMIT_S = 60.0
BASE_CHAIN = ['odom', 'base_link']


@pytest.fixture
def tree(probe: Probe) -> Callable[[], FrameTree]:
    """Return a maker of the tree of all transforms heard so far."""
    moving, static = probe.listen(TFMessage, 'tf'), probe.listen(TFMessage, 'tf_static')

    def make() -> FrameTree:
        made = FrameTree()
        for message in [*static, *moving]:
            for link in links_from_message(message):
                assert isinstance(link, Link)
                made.add(link)
        return made

    return make


def test_localization_only_stands_in_for_amcl(
    start: Callable[..., object], room: Path, domain: int, probe: Probe, tree
) -> None:
    """No map to odom until RViz gives a pose; then the tree, a covariance, and nobody drives."""
    truth = probe.listen(Odometry, 'ground_truth')
    poses: list[PoseWithCovarianceStamped] = []
    probe.node.create_subscription(PoseWithCovarianceStamped, 'amcl_pose', poses.append, 10)
    run = start(
        *('--scenario', str(room), '--localization-only', '--unknown-start'),
        *('--remap', 'pose:=amcl_pose'),
        *('--domain', str(domain)),
        domain=domain,
    )
    probe.wait_for(lambda: 'everything is up' in run.process.output, 'the nodes', UP_LIMIT_S)
    assert set(run.family()) == {'uwb_driver', 'odom_node', 'fusion_node', 'sim_bridge'}
    probe.wait_for(lambda: tree().chain('odom', 'uwb_tag'), 'odom to the sensors')
    probe.spin(0.3)
    assert tree().chain('map', 'odom') is None
    assert probe.node.count_publishers('cmd_vel') == 0

    message = PoseWithCovarianceStamped()
    message.header = truth[-1].header  # of now, in map, as RViz stamps it
    message.pose.pose = truth[-1].pose.pose
    for index, variance in ((0, 0.25), (7, 0.25), (35, 0.06854)):  # what RViz sends
        message.pose.covariance[index] = variance
    probe.repeat(
        'initialpose',
        lambda: message,
        lambda: tree().chain('map', 'base_link'),
        'map to base_link',
        period_s=5.0,
    )
    for frame in ('imu_link', 'uwb_tag', 'ultrasonic_front'):
        links = tree().chain('map', frame)
        assert [link.child for link in links] == [*BASE_CHAIN, frame]

    def drive() -> Twist:
        command = Twist()
        command.linear.x = 0.3
        return command

    # Whoever navigates drives the base; the pose goes with it.
    at = truth[-1].pose.pose.position.x
    probe.repeat('cmd_vel', drive, lambda: truth[-1].pose.pose.position.x > at + 0.6, 'driving')
    newest = poses[-1]
    covariance = np.reshape(newest.pose.covariance, (6, 6))[np.ix_([0, 1, 5], [0, 1, 5])]
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    assert covariance[0, 0] < 0.05
    near = min(truth, key=lambda item: abs(seconds(item) - seconds(newest)))
    place, true = newest.pose.pose, near.pose.pose
    # Ranges have a deviation of 0.1 m; the two stamps are up to 20 ms of driving apart.
    assert np.hypot(place.position.x - true.position.x, place.position.y - true.position.y) < 0.15
    turned = heading_from_quaternion(place.orientation) - heading_from_quaternion(true.orientation)
    assert abs(turned) < 0.15
    assert run.process.end() == 0


def seconds(message: object) -> float:
    """Return the stamp of a message [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
