"""Wheels, IMU, magnetometer, ultrasonic and velocities: there and back, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, Twist
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Range

from tablerunner.geometry.angles import difference
from tablerunner.geometry.rotation import quaternion_of_rpy, rotation_of_rpy
from tablerunner.types import (
    ImuSample,
    MagneticSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
)
from tablerunner_ros.conversions.imu import (
    imu_from_message,
    imu_to_message,
    magnetic_from_message,
    magnetic_to_message,
)
from tablerunner_ros.conversions.ultrasonic import ultrasonic_from_message, ultrasonic_to_message
from tablerunner_ros.conversions.velocity import (
    velocity_from_message,
    velocity_to_twist,
    velocity_to_twist_stamped,
)
from tablerunner_ros.conversions.wheels import wheels_from_message, wheels_to_message
from tablerunner_ros.testing.strategies import headings, lengths, positive, stamps, words

NAN = math.nan
LEFT, RIGHT = 'left', 'right'


def wired(message: Any) -> Any:
    """Return a message as it comes out of DDS."""
    return deserialize_message(serialize_message(message), type(message))


@given(st.builds(WheelSample, stamps, lengths, lengths, lengths, lengths))
def test_wheels_there_and_back_are_the_same(sample: WheelSample) -> None:
    """Angles and speeds of both wheels."""
    assert (
        wheels_from_message(wired(wheels_to_message(sample, LEFT, RIGHT)), LEFT, RIGHT) == sample
    )


@given(st.permutations(['left', 'right', 'arm', 'head']))
def test_wheels_are_found_by_name_among_other_joints(names: list[str]) -> None:
    """The order of the joints does not matter."""
    message = wheels_to_message(WheelSample(1, 0.0, 0.0), LEFT, RIGHT)
    message.name = names
    message.position = [float(len(name)) for name in names]
    result = wheels_from_message(message, LEFT, RIGHT)
    assert isinstance(result, WheelSample)
    assert (result.left_angle_rad, result.right_angle_rad) == (4.0, 5.0)
    assert math.isnan(result.left_speed_rad_s)


@pytest.mark.parametrize('angles', [[NAN, NAN, NAN], []], ids=['NaN', 'none'])
def test_wheels_that_measure_speeds_only(angles: list[float]) -> None:
    """joint_state_broadcaster writes NaN for what no joint has; other drivers leave it out."""
    message = wheels_to_message(WheelSample(5, 0.0, 0.0), LEFT, RIGHT)
    message.name = ['arm', RIGHT, LEFT]
    message.position, message.velocity = angles, [NAN, 2.0, 1.0]
    sample = wheels_from_message(wired(message), LEFT, RIGHT)
    assert isinstance(sample, WheelSample)
    assert sample.speeds_rad_s == (1.0, 2.0)
    assert all(math.isnan(angle) for angle in sample.angles_rad)


@given(st.permutations(['front_left', 'front_right', 'rear_left', 'rear_right', 'arm']))
def test_wheels_of_several_on_a_side_are_paired(names: list[str]) -> None:
    """Left with right as the parameters list them, in whatever order a message has them."""
    value = {'front_left': 1.0, 'front_right': 2.0, 'rear_left': 3.0, 'rear_right': 4.0}
    message = wheels_to_message(WheelSample(5, 0.0, 0.0), LEFT, RIGHT)
    message.name = names
    message.position = [value.get(name, NAN) for name in names]
    message.velocity = [10.0 * value.get(name, NAN) for name in names]
    sample = wheels_from_message(
        wired(message), ('front_left', 'rear_left'), ('front_right', 'rear_right')
    )
    assert isinstance(sample, WheelSample)
    assert sample.angles_rad == (1.0, 2.0, 3.0, 4.0)
    assert sample.speeds_rad_s == (10.0, 20.0, 30.0, 40.0)


@pytest.mark.parametrize(
    ('change', 'key', 'reason'),
    [
        (lambda m: setattr(m, 'name', ['left', 'other']), 'right', 'joint is missing'),
        (lambda m: setattr(m, 'name', []), 'left', 'joint is missing'),
        (lambda m: setattr(m, 'name', ['arm', 'head']), '', 'of other joints'),
        (lambda m: setattr(m, 'position', [1.0]), '', 'names and positions differ in number'),
        (lambda m: setattr(m, 'position', []), 'left', 'wheel angle is not finite'),
        (lambda m: setattr(m, 'position', [1.0, NAN]), 'right', 'wheel angle is not finite'),
        (lambda m: setattr(m, 'position', [math.inf, 1.0]), 'left', 'wheel angle is not finite'),
        (lambda m: setattr(m, 'velocity', [1.0]), '', 'names and velocities differ in number'),
    ],
)
def test_wheels_malformed_are_refused(change: Any, key: str, reason: str) -> None:
    """Each fault has its reason, and none raises."""
    message = wheels_to_message(WheelSample(3, 1.0, 2.0), LEFT, RIGHT)
    change(message)
    assert wheels_from_message(wired(message), LEFT, RIGHT) == Refusal(
        3, 'joint_states', key, reason
    )


@given(st.builds(ImuSample, stamps, lengths, lengths, lengths, headings, positive))
def test_imu_there_and_back_is_the_same(sample: ImuSample) -> None:
    """Turn rate, accelerations, heading and variance."""
    back = imu_from_message(wired(imu_to_message(sample, 'imu_link')))
    assert isinstance(back, ImuSample)
    assert abs(difference(back.yaw_rad, sample.yaw_rad)) < 1e-9
    assert (back.stamp, back.yaw_rate_rad_s, back.yaw_rate_variance) == (
        sample.stamp,
        sample.yaw_rate_rad_s,
        sample.yaw_rate_variance,
    )
    assert (back.forward_acceleration_m_s2, back.lateral_acceleration_m_s2) == (
        sample.forward_acceleration_m_s2,
        sample.lateral_acceleration_m_s2,
    )


def test_imu_without_orientation_or_acceleration_has_none() -> None:
    """A first covariance element of -1 means "not measured", whatever stands in the field."""
    message = wired(imu_to_message(ImuSample(1, 0.5), 'imu_link'))
    assert message.orientation_covariance[0] == -1.0
    message.orientation.w = NAN
    back = imu_from_message(message)
    assert isinstance(back, ImuSample)
    assert math.isnan(back.yaw_rad)
    assert math.isnan(back.forward_acceleration_m_s2)


@given(headings, headings)
def test_imu_mounted_askew_is_turned_into_the_robot(mount: float, heading: float) -> None:
    """An IMU whose x axis points along `mount` feels forward acceleration in its own axes."""
    message = imu_to_message(
        ImuSample(1, 0.1, math.cos(mount), -math.sin(mount), heading), 'imu_link'
    )
    back = imu_from_message(message, mount)
    assert isinstance(back, ImuSample)
    assert back.forward_acceleration_m_s2 == pytest.approx(1.0)
    assert back.lateral_acceleration_m_s2 == pytest.approx(0.0, abs=1e-12)
    assert abs(difference(back.yaw_rad, heading - mount)) < 1e-9


@given(headings, st.floats(-1.5, 1.5), headings, headings, st.floats(-3.0, 3.0))
def test_imu_mounted_anyhow_is_turned_into_the_robot(
    roll: float, pitch: float, yaw: float, heading: float, rate: float
) -> None:
    """A robot on the floor that turns and accelerates, felt in the axes of a tilted IMU.

    What the IMU says is made with vectors and quaternions, what comes back with the mounting's
    matrix.
    """
    mount = rotation_of_rpy(roll, pitch, yaw)
    message = imu_to_message(ImuSample(1, 0.0, 0.0, 0.0, heading, 1.0), 'imu_link')
    turn, felt = message.angular_velocity, message.linear_acceleration
    turn.x, turn.y, turn.z = (float(number) for number in mount.T @ (0.0, 0.0, rate))
    felt.x, felt.y, felt.z = (float(number) for number in mount.T @ (0.5, 0.25, 9.81))
    message.angular_velocity_covariance = [float(number) for number in np.diag([4.0] * 3).ravel()]
    base = np.array([0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading)])
    x, y, z, w = quaternion_product(base, np.array(quaternion_of_rpy(roll, pitch, yaw)))
    message.orientation = Quaternion(x=x, y=y, z=z, w=w)
    sample = imu_from_message(wired(message), mount=mount)
    assert isinstance(sample, ImuSample)
    assert sample.yaw_rate_rad_s == pytest.approx(rate, abs=1e-9)
    assert sample.yaw_rate_variance == pytest.approx(4.0)
    assert sample.forward_acceleration_m_s2 == pytest.approx(0.5, abs=1e-9)
    assert sample.lateral_acceleration_m_s2 == pytest.approx(0.25, abs=1e-9)
    assert abs(difference(sample.yaw_rad, heading)) < 1e-6


def quaternion_product(one: np.ndarray, two: np.ndarray) -> list[float]:
    """Return the rotation by `two`, then by `one` (x, y, z, w)."""
    vector = one[3] * two[:3] + two[3] * one[:3] + np.cross(one[:3], two[:3])
    return [*map(float, vector), float(one[3] * two[3] - one[:3] @ two[:3])]


def test_imu_upside_down_turns_the_other_way() -> None:
    """Rolled by half a turn: what it feels as clockwise is counter-clockwise."""
    message = wired(imu_to_message(ImuSample(1, -0.5), 'imu_link'))
    sample = imu_from_message(message, mount=rotation_of_rpy(math.pi, 0.0, 0.0))
    assert isinstance(sample, ImuSample)
    assert sample.yaw_rate_rad_s == pytest.approx(0.5)


def test_imu_whose_orientation_is_all_zeros_has_none() -> None:
    """As drivers of bare gyroscopes leave it, the covariance of -1 forgotten."""
    message = imu_to_message(ImuSample(1, 0.5, 0.0, 0.0, 0.3), 'imu_link')
    message.orientation = Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
    sample = imu_from_message(wired(message))
    assert isinstance(sample, ImuSample)
    assert math.isnan(sample.yaw_rad)
    assert sample.yaw_rate_rad_s == 0.5


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda m: setattr(m.angular_velocity, 'z', NAN), 'turn rate is not finite'),
        (lambda m: m.angular_velocity_covariance.__setitem__(0, -1.0), 'gives no angular'),
        (lambda m: m.angular_velocity_covariance.__setitem__(8, -2.0), 'variance is not'),
        (lambda m: m.angular_velocity_covariance.__setitem__(8, NAN), 'variance is not'),
        (lambda m: setattr(m.orientation, 'w', NAN), 'orientation is not finite'),
        (lambda m: setattr(m.orientation, 'w', 3.0), 'orientation is not a unit quaternion'),
    ],
)
def test_imu_malformed_is_refused(change: Any, reason: str) -> None:
    """Each fault has its reason, and none raises."""
    message = imu_to_message(ImuSample(3, 0.1, 0.0, 0.0, 0.0), 'imu_link')
    change(message)
    result = imu_from_message(wired(message))
    assert isinstance(result, Refusal)
    assert (result.stamp, result.source) == (3, 'imu/data')
    assert result.reason.startswith(reason)


@given(st.builds(MagneticSample, stamps, lengths, lengths, lengths))
def test_magnetic_there_and_back_is_the_same(sample: MagneticSample) -> None:
    """The field in base_link axes."""
    message = wired(magnetic_to_message(sample, 'imu_link'))
    assert magnetic_from_message(message) == sample
    message.magnetic_field.x = NAN
    assert isinstance(magnetic_from_message(message), Refusal)


@given(
    st.builds(
        UltrasonicSample,
        stamps,
        words,
        st.one_of(st.floats(0.0, 10.0, width=32), st.just(math.inf)),
        st.floats(0.0, 1.0, width=32),
        st.floats(1.0, 10.0, width=32),
        st.floats(0.0, 1.0, width=32),
    )
)
def test_ultrasonic_there_and_back_is_the_same(sample: UltrasonicSample) -> None:
    """No echo stays no echo."""
    message = wired(ultrasonic_to_message(sample))
    assert message.radiation_type == Range.ULTRASOUND
    assert ultrasonic_from_message(message) == sample


def test_ultrasonic_too_near_is_an_obstacle_at_the_least_range() -> None:
    """REP-117: minus infinity is an object too near to measure, and must stop the robot."""
    message = ultrasonic_to_message(UltrasonicSample(1, 'front', 0.0, 0.25, 4.0, 0.5))
    message.range = -math.inf
    result = ultrasonic_from_message(wired(message))
    assert isinstance(result, UltrasonicSample)
    assert result.range_m == 0.25


@pytest.mark.parametrize(
    ('field', 'value', 'reason'),
    [
        ('range', NAN, 'range is not a number'),
        ('range', -1.0, 'negative range'),
        ('max_range', NAN, 'limits of the sensor are not finite'),
        ('min_range', -1.0, 'limits of the sensor are not finite'),
    ],
)
def test_ultrasonic_malformed_is_refused(field: str, value: float, reason: str) -> None:
    """Each fault has its reason and names the sensor."""
    message = ultrasonic_to_message(UltrasonicSample(1, 'front', 1.0, 0.25, 4.0, 0.5))
    setattr(message, field, value)
    assert ultrasonic_from_message(wired(message)) == Refusal(1, 'ultrasonic', 'front', reason)


@given(st.builds(Velocity, lengths, lengths), stamps)
def test_velocity_there_and_back_is_the_same(velocity: Velocity, stamp: int) -> None:
    """As Twist and as TwistStamped."""
    assert velocity_from_message(wired(velocity_to_twist(velocity))) == velocity
    stamped = wired(velocity_to_twist_stamped(velocity, stamp, 'base_link'))
    assert velocity_from_message(stamped) == velocity


def test_velocity_malformed_is_refused() -> None:
    """NaN, and what a differential drive cannot do."""
    message = Twist()
    message.linear.x = NAN
    assert velocity_from_message(message) == Refusal(0, 'cmd_vel', '', 'velocity is not finite')
    message = Twist()
    message.linear.y = 0.1
    assert velocity_from_message(message) == Refusal(0, 'cmd_vel', '', 'sideways velocity')
