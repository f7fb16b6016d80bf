"""odom_node with what ros2_control and common IMU drivers publish, over DDS, field by field."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, JointState
from tf2_msgs.msg import TFMessage

from odom_node.node import OdomNode
from tablerunner.geometry.rotation import quaternion_of_rpy
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.conversions.stamp import fill_stamp
from tablerunner_ros.testing.probe import Probe

NAN = math.nan
RADIUS, TRACK, STEP_S = 0.06, 0.34, 0.02
SPEED, RATE, STEPS = 0.4, 0.5, 100

SYSTEM_DEFAULT = QoSProfile(depth=10)
"""Reliable, volatile: rclcpp::SystemDefaultsQoS, as the broadcasters of ros2_control have it."""


class Base:
    """Publishers with the QoS of the drivers, and a robot on a circle to the left."""

    def __init__(self, probe: Probe, **parameters: Any) -> None:
        self.probe = probe
        probe.host(
            OdomNode, parameter_overrides=[Parameter(n, value=v) for n, v in parameters.items()]
        )
        self.odom = probe.listen(Odometry, 'odom')
        self.joints = probe.node.create_publisher(JointState, 'joint_states', SYSTEM_DEFAULT)
        self.imus = probe.node.create_publisher(Imu, 'imu/data', SYSTEM_DEFAULT)
        probe.wait_for(
            lambda: self.joints.get_subscription_count() and self.imus.get_subscription_count(),
            'the node',
        )
        probe.heard('odom')
        self.stamp = time.time_ns() - 60 * 10**9
        self.left = self.right = 0.0

    def drive(
        self, joints: Callable[[Base, int], JointState], imu: Callable[[float], Imu] | None = None
    ) -> Odometry:
        """Drive the circle; `joints` and `imu` say what the drivers make of it."""
        for step in range(STEPS + 1):
            if step:
                self.stamp += round(STEP_S * 1e9)
                self.left += (SPEED - 0.5 * TRACK * RATE) * STEP_S / RADIUS
                self.right += (SPEED + 0.5 * TRACK * RATE) * STEP_S / RADIUS
            if imu is not None:
                message = imu(RATE)
                fill_stamp(message.header.stamp, self.stamp)
                self.imus.publish(message)
                self.probe.spin(0.002)
            message = joints(self, step)
            fill_stamp(message.header.stamp, self.stamp)
            self.joints.publish(message)
            self.probe.wait_for(lambda count=step: len(self.odom) > count, 'odometry')
        return self.odom[-1]


SPEEDS = ((SPEED - 0.5 * TRACK * RATE) / RADIUS, (SPEED + 0.5 * TRACK * RATE) / RADIUS)


def joints(**numbers: tuple[float, float]) -> JointState:
    """Return joints by name, with angle and speed; effort NaN as the broadcaster leaves it."""
    message = JointState()
    message.header.frame_id = 'base_link'
    message.name = list(numbers)
    message.position = [pair[0] for pair in numbers.values()]
    message.velocity = [pair[1] for pair in numbers.values()]
    message.effort = [NAN] * len(numbers)
    return message


def skid_steer(base: Base, step: int) -> JointState:
    """Return joint_state_broadcaster's message of two wheels a side and a gripper, shuffled."""
    left, right = (base.left, SPEEDS[0]), (base.right, SPEEDS[1])
    table = {
        'gripper_joint': (0.02, NAN),
        'front_left': left,
        'front_right': right,
        'rear_left': left,
        'rear_right': right,
    }
    orders = list(itertools.permutations(table))
    return joints(**{name: table[name] for name in orders[(7 * step) % len(orders)]})


def velocity_only(_base: Base, _step: int) -> JointState:
    """Return it of hardware that has velocity state interfaces only: positions are NaN."""
    return joints(right_wheel=(NAN, SPEEDS[1]), left_wheel=(NAN, SPEEDS[0]))


def velocity_alone(_base: Base, _step: int) -> JointState:
    """Return what a small driver sends: names and speeds, no array of positions at all."""
    return JointState(name=['left_wheel', 'right_wheel'], velocity=list(SPEEDS))


def wrapping(base: Base, _step: int) -> JointState:
    """Return angles of absolute encoders, -pi to pi, without speeds; the right one reversed."""
    message = JointState(name=['left_wheel', 'right_wheel'])
    message.position = [math.remainder(base.left, math.tau), math.remainder(-base.right, math.tau)]
    return message


def expect_circle(message: Odometry) -> None:
    """Compare with the arc that was driven: its chord is exact to a part in a thousand."""
    turn = RATE * STEP_S * STEPS
    radius = SPEED / RATE
    place = message.pose.pose.position
    assert place.x == pytest.approx(radius * math.sin(turn), abs=2e-3)
    assert place.y == pytest.approx(radius * (1.0 - math.cos(turn)), abs=2e-3)
    heading = heading_from_quaternion(message.pose.pose.orientation)
    assert heading == pytest.approx(turn, abs=2e-3)


NAMES = {'left_joints': ['left_wheel'], 'right_joints': ['right_wheel']}


@pytest.mark.parametrize(
    ('source', 'parameters'),
    [
        (
            skid_steer,
            {
                'left_joints': ['front_left', 'rear_left'],
                'right_joints': ['front_right', 'rear_right'],
            },
        ),
        (velocity_only, NAMES),
        (velocity_alone, NAMES),
        (wrapping, {**NAMES, 'wheels.wrap': math.tau, 'wheels.right_reversed': True}),
    ],
    ids=['skid steer', 'velocity only', 'velocity alone', 'wrapping'],
)
def test_wheels_of_real_drivers_lead_round_the_circle(
    probe: Probe, source: Callable[[Base, int], JointState], parameters: dict[str, Any]
) -> None:
    """By the wheels alone, so that each of them counts."""
    base = Base(probe, heading_source='wheels', **parameters)
    expect_circle(base.drive(source))


def test_joints_of_others_on_the_same_topic_are_no_fault(
    probe: Probe, quick_diagnostics: None
) -> None:
    """A second broadcaster, of an arm: left out, counted, no warning."""
    base = Base(probe, heading_source='wheels', **NAMES)

    def both(robot: Base, step: int) -> JointState:
        arm = joints(shoulder=(0.1 * step, 0.0), elbow=(0.2, 0.0))
        fill_stamp(arm.header.stamp, robot.stamp + 1_000_000)
        robot.joints.publish(arm)
        return velocity_only(robot, step)

    expect_circle(base.drive(both))
    status = probe.wait_diagnostic(
        'odom_node: joint_states', 'refused: of other joints', lambda count: int(count) > 50
    )
    assert status.level == b'\x00'


def gyroscope(rate: float) -> Imu:
    """Return what a bare gyroscope with accelerometer gives: no orientation, marked by -1."""
    message = Imu()
    message.header.frame_id = 'imu_link'
    message.angular_velocity.z = rate
    message.linear_acceleration.z = 9.81
    message.orientation_covariance[0] = -1.0
    return message


def upside_down(rate: float) -> Imu:
    """Return an IMU hung under a plate, with its own absolute orientation and covariances."""
    message = gyroscope(-rate)
    message.header.frame_id = 'imu_optical'
    message.orientation = Quaternion(x=1.0, y=0.0, z=0.0, w=0.0)
    message.orientation_covariance = [0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.05]
    message.linear_acceleration.z = -9.81
    return message


def unequal(_base: Base, _step: int) -> JointState:
    """Return wheels that tell of driving straight on: what turns the robot is the gyroscope."""
    return joints(left_wheel=(NAN, SPEED / RADIUS), right_wheel=(NAN, SPEED / RADIUS))


@pytest.mark.parametrize(
    ('imu', 'parameters'),
    [(gyroscope, {}), (upside_down, {'imu_tilt': [math.pi, 0.0]})],
    ids=['no orientation', 'upside down'],
)
def test_imu_of_real_drivers_gives_the_turn(
    probe: Probe, imu: Callable[[float], Imu], parameters: dict[str, Any]
) -> None:
    """Wheels that know nothing of the turn, and an IMU that does."""
    base = Base(probe, **NAMES, **parameters)
    expect_circle(base.drive(unequal, imu))


def test_imu_mounted_as_robot_state_publisher_says(probe: Probe, quick_diagnostics: None) -> None:
    """base_link to a mast, and the IMU upside down on it: two links of tf_static."""
    base = Base(probe, imu_from_tf=True, **NAMES)
    message = upside_down(RATE)
    fill_stamp(message.header.stamp, base.stamp - 10**9)
    base.imus.publish(message)
    probe.wait_diagnostic(
        'odom_node: imu/data',
        'refused: no static transform from base_link to its frame (imu_optical)',
        '1',
    )
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    static = probe.node.create_publisher(TFMessage, 'tf_static', latched)
    links = []
    for parent, child, rpy in (
        ('base_link', 'mast', (0.0, 0.0, 1.0)),
        ('mast', 'imu_optical', (math.pi, 0.0, 0.3)),
    ):
        link = TransformStamped(child_frame_id=child)
        link.header.frame_id = parent
        x, y, z, w = quaternion_of_rpy(*rpy)
        link.transform.rotation = Quaternion(x=x, y=y, z=z, w=w)
        links.append(link)
    static.publish(TFMessage(transforms=links))
    probe.wait_for(lambda: static.get_subscription_count() > 0, 'the node on tf_static')
    probe.spin(0.1)
    expect_circle(base.drive(unequal, upside_down))
