"""odom_node over DDS: where the wheels lead, and what it refuses."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState
from tf2_msgs.msg import TFMessage

from odom_node.node import OdomNode
from tablerunner.errors import ConfigError
from tablerunner.types import ImuSample, WheelSample
from tablerunner_ros.conversions.imu import imu_to_message
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.conversions.wheels import wheels_to_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes

LEFT, RIGHT = 'left_wheel_joint', 'right_wheel_joint'
RADIUS, TRACK = 0.06, 0.34
NAN = math.nan


class Wheels:
    """An odom_node in this process, a robot that turns its wheels, and the probe between."""

    def __init__(self, probe: Probe, **parameters: Any) -> None:
        self.probe = probe
        self.node = probe.host(
            OdomNode,
            parameter_overrides=[
                Parameter(name.replace('__', '.'), value=value)
                for name, value in parameters.items()
            ],
        )
        self.odom = probe.listen(Odometry, 'odom')
        self.tf = probe.listen(TFMessage, 'tf')
        probe.speak(JointState, 'joint_states')
        probe.speak(Imu, 'imu/data')
        for topic in ('joint_states', 'imu/data'):
            probe.connected(topic)
        probe.heard('odom')
        self.stamp = time.time_ns() - 60 * 10**9
        self.left = self.right = 0.0

    def send(
        self, stamp: int | None = None, change: Callable[[JointState], None] | None = None
    ) -> None:
        """Publish the wheels as they are."""
        sample = WheelSample(self.stamp if stamp is None else stamp, self.left, self.right)
        message = wheels_to_message(sample, LEFT, RIGHT)
        if change is not None:
            change(message)
        self.probe.publish('joint_states', message)

    def imu(self, rate: float, stamp: int | None = None) -> None:
        """Publish a turn rate."""
        sample = ImuSample(self.stamp if stamp is None else stamp, rate)
        self.probe.publish('imu/data', imu_to_message(sample, 'imu_link'))

    def expect(self, count: int) -> Odometry:
        """Wait for as many odometry messages in all, and return the last."""
        self.probe.wait_for(lambda: len(self.odom) >= count, f'{count} odometry messages')
        return self.odom[-1]

    def drive(self, speed: float, rate: float, steps: int, imu: bool = True) -> Odometry:
        """Drive at constant speed for steps of 20 ms; return the last odometry."""
        for _ in range(steps):
            before = len(self.odom)
            self.stamp += 20_000_000
            self.left += (speed - 0.5 * TRACK * rate) * 0.02 / RADIUS
            self.right += (speed + 0.5 * TRACK * rate) * 0.02 / RADIUS
            if imu:
                self.imu(rate)
                # Two topics have no order between them: the IMU's message must be taken first.
                self.probe.spin(0.002)
            self.send()
            self.expect(before + 1)
        return self.odom[-1]

    def refused(self, reason: str, source: str = 'joint_states') -> None:
        """Wait until a refusal is on /diagnostics."""
        self.probe.wait_diagnostic(
            f'odom_node: {source}', f'refused: {reason}', lambda count: int(count) >= 1
        )


@pytest.fixture
def wheels(probe: Probe) -> Wheels:
    item = Wheels(probe)
    item.send()
    item.expect(1)
    return item


def test_odom_straight_ahead_is_the_distance_driven(wheels: Wheels) -> None:
    """One metre forward, with frames, stamp and speed."""
    message = wheels.drive(0.5, 0.0, 100)
    assert message.pose.pose.position.x == pytest.approx(1.0, abs=1e-6)
    assert message.pose.pose.position.y == pytest.approx(0.0, abs=1e-6)
    assert (message.header.frame_id, message.child_frame_id) == ('odom', 'base_link')
    assert stamp_from_message(message.header.stamp) == wheels.stamp
    assert message.twist.twist.linear.x == pytest.approx(0.5, abs=1e-6)
    assert message.pose.covariance[0] > wheels.odom[10].pose.covariance[0] > 0.0


@pytest.mark.parametrize('source', ['wheels', 'gyro'])
def test_odom_quarter_circle_to_the_left_ends_left(probe: Probe, source: str) -> None:
    """Counter-clockwise is positive, by wheels (Sun 4, corrected) and by gyroscope alike."""
    item = Wheels(probe, heading_source=source)
    item.send()
    item.expect(1)
    steps = 100
    rate = 0.5 * math.pi / (0.02 * steps)
    item.imu(rate)
    probe.spin(0.02)
    message = item.drive(rate * 1.0, rate, steps)  # a circle of radius 1 m
    assert message.pose.pose.position.x == pytest.approx(1.0, abs=0.03)
    assert message.pose.pose.position.y == pytest.approx(1.0, abs=0.03)
    heading = heading_from_quaternion(message.pose.pose.orientation)
    assert heading == pytest.approx(0.5 * math.pi, abs=0.03)
    assert message.twist.twist.angular.z == pytest.approx(rate, rel=0.02)


def test_odom_transform_is_the_pose(wheels: Wheels) -> None:
    """The transform odom to base_link says what odom says, at the same stamp."""
    message = wheels.drive(0.5, 0.3, 10)
    wheels.probe.wait_for(lambda: len(wheels.tf) >= len(wheels.odom), 'the transforms')
    transform = wheels.tf[-1].transforms[0]
    assert transform.header == message.header
    assert transform.child_frame_id == 'base_link'
    assert transform.transform.translation.x == message.pose.pose.position.x
    assert transform.transform.translation.y == message.pose.pose.position.y
    assert transform.transform.rotation == message.pose.pose.orientation


def test_odom_names_and_transform_follow_the_parameters(probe: Probe) -> None:
    """Another robot's frames, and no transform when somebody else publishes it."""
    item = Wheels(probe, odom_frame='o', base_frame='b', publish_tf=False)
    item.send()
    item.expect(1)
    message = item.drive(0.5, 0.0, 5)
    assert (message.header.frame_id, message.child_frame_id) == ('o', 'b')
    probe.spin(0.1)
    assert item.tf == []


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda w: w.send(stamp=0), 'zero stamp'),
        (lambda w: w.send(stamp=time.time_ns() + 5 * 10**9), 'stamp in the future'),
        (lambda w: w.send(stamp=w.stamp - 10**8), 'stamp does not advance'),
        (lambda w: w.send(change=lambda m: setattr(m, 'name', [LEFT, 'x'])), 'joint is missing'),
        (lambda w: w.send(change=lambda m: setattr(m, 'position', [NAN, 0.0])), 'wheel angle'),
        (lambda w: w.send(change=lambda m: setattr(m, 'position', [0.0])), 'names and positions'),
        (
            lambda w: w.send(
                stamp=w.stamp + 10_000_000,
                change=lambda m: setattr(m, 'position', [900.0, 900.0]),
            ),
            'encoder jump',
        ),
    ],
)
def test_odom_bad_wheels_are_refused_and_counted(
    wheels: Wheels, spoil: Callable[[Wheels], None], reason: str
) -> None:
    """No odometry comes of it, the reason stands on /diagnostics, and no distance is lost."""
    wheels.drive(0.5, 0.0, 10)
    count = len(wheels.odom)
    spoil(wheels)

    def counted() -> bool:
        status = wheels.probe.diagnostic('odom_node: joint_states')
        keys = [] if status is None else [item.key for item in status.values]
        return any(key.startswith(f'refused: {reason}') for key in keys)

    wheels.probe.wait_for(counted, f'{reason!r} on /diagnostics')
    assert len(wheels.odom) == count
    message = wheels.drive(0.5, 0.0, 10)
    assert message.pose.pose.position.x == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda w: w.imu(NAN), 'turn rate is not finite'),
        (lambda w: w.imu(50.0), 'yaw rate beyond max_rate'),
        (lambda w: w.imu(0.1, stamp=0), 'zero stamp'),
        (lambda w: w.imu(0.1, stamp=time.time_ns() + 5 * 10**9), 'stamp in the future'),
    ],
)
def test_odom_bad_imu_is_refused_and_counted(
    wheels: Wheels, spoil: Callable[[Wheels], None], reason: str
) -> None:
    """As for the wheels."""
    spoil(wheels)
    wheels.refused(reason, 'imu/data')


def test_odom_silent_imu_leaves_the_heading_to_the_wheels_and_says_so(wheels: Wheels) -> None:
    """The robot goes on; /diagnostics tells that its heading is worse."""
    message = wheels.drive(0.2, 0.5, 50, imu=False)
    heading = heading_from_quaternion(message.pose.pose.orientation)
    assert heading == pytest.approx(0.5, abs=1e-3)
    wheels.refused('imu silent: heading from the wheels', 'imu/data')


def test_odom_wheel_that_slips_is_counted_and_its_distance_doubted(wheels: Wheels) -> None:
    """One wheel turns twice as far as the gyroscope can agree with, for a quarter of a second."""
    calm = wheels.drive(0.5, 0.0, steps=20)
    for _ in range(12):
        wheels.stamp += 20_000_000
        wheels.left += 0.5 * 0.02 / RADIUS
        wheels.right += 1.0 * 0.02 / RADIUS
        wheels.imu(0.0)
        wheels.send()
    slipped = wheels.expect(33)
    assert slipped.twist.covariance[0] > 10 * calm.twist.covariance[0]
    wheels.refused('wheels slip: distance doubted')


def test_odom_stream_that_begins_again_is_taken_up_and_reported(wheels: Wheels) -> None:
    """A bag that starts anew, with encoders that start anew."""
    wheels.drive(0.5, 0.0, 10)
    count = len(wheels.odom)
    wheels.stamp -= 30 * 10**9
    wheels.left = wheels.right = 0.0
    for _ in range(3):
        wheels.stamp += 20_000_000
        wheels.send()
    wheels.expect(count + 1)
    wheels.drive(0.5, 0.0, 10)
    wheels.probe.wait_diagnostic('odom_node: joint_states', 'restarts', '1')


def test_odom_parameter_changed_while_it_runs(wheels: Wheels) -> None:
    """Noise may be tuned; what the robot is made of may not change under way."""
    probe = wheels.probe
    wheels.drive(0.5, 0.0, 10)
    assert probe.set_parameter('odom_node', 'noise.distance', 0.5) == ''
    before = wheels.odom[-1].pose.covariance[0]
    wheels.drive(0.5, 0.0, 10)
    assert wheels.odom[-1].pose.covariance[0] > before + 0.01
    assert 'out of range' in probe.set_parameter('odom_node', 'noise.distance', -1.0)
    assert 'gyro.timeout: got 0.0' in probe.set_parameter('odom_node', 'gyro.timeout', 0.0)
    assert 'read-only' in probe.set_parameter('odom_node', 'wheels.track', 0.5)


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'wheels.track': -1.0}, 'wheels.track: got -1.0, expected a number above 0'),
        ({'heading_source': 'stars'}, "heading_source: got 'stars', expected one of wheels, gyro"),
        ({'left_joints': ['a', 'b']}, "right_joints: got ['right_wheel_joint'], expected as many"),
        (
            {'right_joints': [LEFT]},
            f"right_joints: got ['{LEFT}'], expected each joint named once",
        ),
        ({'imu_tilt': [0.1]}, 'imu_tilt: got [0.1], expected roll and pitch'),
    ],
)
def test_odom_bad_parameter_is_named(probe: Probe, parameters: dict[str, Any], words: str) -> None:
    """The error names node, parameter, value and what was expected."""
    given = [Parameter(name, value=value) for name, value in parameters.items()]
    with pytest.raises(ConfigError, match=re.escape(f'parameters of /odom_node: {words}')):
        OdomNode(context=probe.context, parameter_overrides=given)


def test_odom_bad_parameter_file_exits_2_with_one_sentence(processes: Processes) -> None:
    """That error is all that the process says."""
    process = processes.node('odom_node', 'odom_node', {'wheels': {'track': -1.0}})
    assert process.wait() == 2
    assert len(process.output.splitlines()) == 1
    assert process.output.startswith(
        'parameters of /odom_node: wheels.track: got -1.0, expected a number above 0'
    )


def test_odom_process_in_a_namespace_works_and_ends_cleanly(
    probe: Probe, processes: Processes
) -> None:
    """All names are relative: a namespace makes a second robot, tf and diagnostics included."""
    process = processes.node('odom_node', 'odom_node', arguments=['-r', '__ns:=/two'])
    odom: list[Odometry] = []
    tf: list[TFMessage] = []
    probe.node.create_subscription(Odometry, '/two/odom', odom.append, 10)
    probe.node.create_subscription(TFMessage, '/two/tf', tf.append, 10)
    publisher = probe.node.create_publisher(JointState, '/two/joint_states', 10)

    def step() -> bool:
        publisher.publish(wheels_to_message(WheelSample(time.time_ns(), 0.0, 0.0), LEFT, RIGHT))
        probe.spin(0.02)
        return bool(odom and tf)

    probe.wait_for(step, 'odometry and its transform')
    names = [name for name, _ in probe.node.get_topic_names_and_types()]
    assert '/two/diagnostics' in names
    assert process.end() == 0
