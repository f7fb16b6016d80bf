"""Poses, odometry and transforms: there and back, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import deserialize_message, serialize_message

from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import UNKNOWN_YAW_VARIANCE, Matrix, OdometrySample, PoseSample, Refusal
from tablerunner_ros.conversions.odometry import odometry_from_message, odometry_to_message
from tablerunner_ros.conversions.pose import (
    goal_from_message,
    goal_to_message,
    path_from_message,
    path_to_message,
    pose_from_message,
    pose_to_message,
)
from tablerunner_ros.conversions.quaternion import heading_from_quaternion, heading_to_quaternion
from tablerunner_ros.testing.strategies import covariances, headings, lengths, poses, stamps
from tablerunner_ros.transforms import transform_message

NAN = math.nan


def wired(message: Any) -> Any:
    """Return a message as it comes out of DDS: it must survive serialisation."""
    return deserialize_message(serialize_message(message), type(message))


def same_pose(left: Pose2, right: Pose2) -> bool:
    """Compare poses; headings on the circle."""
    return (left.x, left.y) == (right.x, right.y) and abs(
        difference(left.heading, right.heading)
    ) < 1e-9


@given(headings)
def test_quaternion_there_and_back_is_the_heading(heading: float) -> None:
    """Also at half a turn, where the sign is free."""
    back = heading_from_quaternion(heading_to_quaternion(heading))
    assert abs(difference(back, heading)) < 1e-9


@given(headings, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_quaternion_of_a_tilted_robot_gives_its_yaw(yaw: float, roll: float, pitch: float) -> None:
    """Roll and pitch of an IMU do not leak into the heading (z-y'-x'' as in REP-103)."""
    half = [0.5 * angle for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = [math.cos(a) for a in half], [math.sin(a) for a in half]
    message = Quaternion(
        w=cr * cp * cy + sr * sp * sy,
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
    )
    assert abs(difference(heading_from_quaternion(message), yaw)) < 1e-9


@given(stamps, poses(), lengths, lengths, covariances(3), covariances(2))
def test_odometry_there_and_back_is_the_same(
    stamp: int, pose: Pose2, linear: float, angular: float, place: Matrix, twist: Matrix
) -> None:
    """Every number of the plane survives, in its place of the 6 x 6."""
    sample = OdometrySample(stamp, pose, linear, angular, place, twist)
    message = wired(odometry_to_message(sample, 'odom', 'base_link'))
    back = odometry_from_message(message, 'odom', 'base_link')
    assert isinstance(back, OdometrySample)
    assert back.stamp == stamp
    assert same_pose(back.pose, pose)
    assert (back.linear_m_s, back.angular_rad_s) == (linear, angular)
    np.testing.assert_array_equal(back.pose_covariance, place)
    np.testing.assert_array_equal(back.twist_covariance, twist)


def test_odometry_covariance_stands_where_ros_expects_it() -> None:
    """x, y and yaw are rows 0, 1 and 5; forward speed and turn rate rows 0 and 5."""
    sample = OdometrySample(
        1, Pose2(), 0.0, 0.0, np.arange(9.0).reshape(3, 3), np.arange(4.0).reshape(2, 2)
    )
    message = odometry_to_message(sample, 'odom', 'base_link')
    place = message.pose.covariance.reshape(6, 6)
    twist = message.twist.covariance.reshape(6, 6)
    # The heading's variance of 8 is more than a turn holds; the rest is as given.
    np.testing.assert_array_equal(place[:2, :2], [[0.0, 1.0], [3.0, 4.0]])
    assert place[5, 5] == UNKNOWN_YAW_VARIANCE
    np.testing.assert_array_equal(twist[np.ix_([0, 5], [0, 5])], [[0.0, 1.0], [2.0, 3.0]])
    assert np.count_nonzero(twist) == 3


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda m: setattr(m.header, 'frame_id', 'map'), 'not in frame odom'),
        (lambda m: setattr(m, 'child_frame_id', 'arm'), 'not of frame base_link'),
        (lambda m: setattr(m.pose.pose.position, 'x', NAN), 'position is not finite'),
        (lambda m: setattr(m.pose.pose.orientation, 'z', NAN), 'orientation is not finite'),
        (lambda m: setattr(m.pose.pose.orientation, 'w', 0.0), 'orientation is an empty'),
        (lambda m: setattr(m.pose.pose.orientation, 'w', 2.0), 'orientation is not a unit'),
        (lambda m: setattr(m.twist.twist.linear, 'x', math.inf), 'velocity is not finite'),
        (lambda m: m.pose.covariance.__setitem__(0, NAN), 'covariance is not one'),
        (lambda m: m.pose.covariance.__setitem__(35, -1.0), 'covariance is not one'),
        (lambda m: m.twist.covariance.__setitem__(0, -1.0), 'covariance is not one'),
    ],
)
def test_odometry_malformed_is_refused(change: Any, reason: str) -> None:
    """Each fault has its reason, and none raises."""
    message = odometry_to_message(OdometrySample(7, Pose2(), 0.0, 0.0), 'odom', 'base_link')
    change(message)
    result = odometry_from_message(wired(message), 'odom', 'base_link')
    assert isinstance(result, Refusal)
    assert (result.stamp, result.source) == (7, 'odom')
    assert result.reason.startswith(reason)


@given(stamps, poses(), covariances(3))
def test_pose_there_and_back_is_the_same(stamp: int, pose: Pose2, covariance: Matrix) -> None:
    """A pose of known heading keeps its covariance."""
    message = wired(pose_to_message(PoseSample(stamp, pose, covariance, 'camera/pose'), 'map'))
    back = pose_from_message(message, 'map', 'camera/pose')
    assert isinstance(back, PoseSample)
    assert (back.stamp, back.source) == (stamp, 'camera/pose')
    assert same_pose(back.pose, pose)
    np.testing.assert_array_equal(back.covariance, covariance)


@given(covariances(3), st.sampled_from([math.inf, UNKNOWN_YAW_VARIANCE, 100.0]))
def test_pose_of_unknown_heading_stays_unknown_and_finite(
    covariance: Matrix, variance: float
) -> None:
    """A message never carries infinity, and what comes back says again that it knows nothing."""
    covariance[2, 2] = variance
    message = pose_to_message(PoseSample(1, Pose2(), covariance, 'uwb/pose'), 'map')
    assert np.isfinite(message.pose.covariance).all()
    back = pose_from_message(wired(message), 'map', 'uwb/pose')
    assert isinstance(back, PoseSample)
    assert back.covariance[2, 2] == math.inf
    np.testing.assert_array_equal(back.covariance[:2, :2], covariance[:2, :2])
    assert not back.covariance[2, :2].any()


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda m: setattr(m.header, 'frame_id', 'odom'), 'not in frame map'),
        (lambda m: setattr(m.header, 'frame_id', ''), 'not in frame map'),
        (lambda m: setattr(m.pose.pose.position, 'y', NAN), 'position is not finite'),
        (lambda m: setattr(m.pose.pose.orientation, 'x', NAN), 'orientation is not finite'),
        (lambda m: m.pose.covariance.__setitem__(7, NAN), 'covariance is not one'),
    ],
)
def test_pose_malformed_is_refused(change: Any, reason: str) -> None:
    """As for odometry."""
    message = pose_to_message(PoseSample(7, Pose2(), np.eye(3)), 'map')
    change(message)
    result = pose_from_message(wired(message), 'map', 'initialpose')
    assert result == Refusal(7, 'initialpose', '', reason)


def test_pose_of_zeros_is_refused() -> None:
    """A message that nobody filled in has no orientation: w is 1 only by ROS's default."""
    message = PoseWithCovarianceStamped()
    message.pose.pose.orientation.w = 0.0
    result = pose_from_message(message, '', 'initialpose')
    assert isinstance(result, Refusal)
    assert 'empty quaternion' in result.reason


@given(st.lists(poses(), min_size=1, max_size=5), stamps)
def test_path_there_and_back_is_the_same(way: list[Pose2], stamp: int) -> None:
    """Number and order of the way points are kept."""
    back = path_from_message(wired(path_to_message(way, stamp, 'map')), 'map')
    assert isinstance(back, tuple)
    assert len(back) == len(way)
    assert all(same_pose(left, right) for left, right in zip(back, way, strict=True))


def test_path_malformed_is_refused() -> None:
    """No way points, another frame, one way point in another frame, one without orientation."""
    assert path_from_message(Path(), '') == Refusal(0, 'waypoints', '', 'path is empty')
    message = path_to_message([Pose2(), Pose2()], 3, 'map')
    assert path_from_message(message, 'odom') == Refusal(3, 'waypoints', '', 'not in frame odom')
    message.poses[1].header.frame_id = 'odom'
    assert path_from_message(message, 'map') == Refusal(3, 'waypoints', '', 'not in frame map')
    message.poses[1].header.frame_id = ''
    assert path_from_message(message, 'map') == (Pose2(), Pose2())
    message.poses[0].pose.orientation.w = NAN
    assert isinstance(path_from_message(message, 'map'), Refusal)


@given(poses(), stamps)
def test_goal_there_and_back_is_the_same(pose: Pose2, stamp: int) -> None:
    """A goal is a pose without covariance."""
    back = goal_from_message(wired(goal_to_message(pose, stamp, 'map')), 'map')
    assert isinstance(back, Pose2)
    assert same_pose(back, pose)
    assert isinstance(goal_from_message(goal_to_message(pose, stamp, 'map'), 'odom'), Refusal)


@given(poses(), stamps)
def test_transform_carries_the_pose(pose: Pose2, stamp: int) -> None:
    """Translation and rotation are those of the child frame in its parent."""
    message = wired(transform_message(stamp, 'map', 'odom', pose))
    transform = message.transform
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'odom')
    assert (transform.translation.x, transform.translation.y) == (pose.x, pose.y)
    assert abs(difference(heading_from_quaternion(transform.rotation), pose.heading)) < 1e-9


def test_odometry_message_filled_again_forgets_the_last() -> None:
    """One message that is reused carries nothing over."""
    full = OdometrySample(1, Pose2(1.0, 2.0, 3.0), 4.0, 5.0, np.eye(3), np.eye(2))
    from tablerunner_ros.conversions.odometry import fill_odometry

    message = odometry_to_message(full, 'odom', 'base_link')
    fill_odometry(message, OdometrySample(2, Pose2(), 0.0, 0.0))
    empty = odometry_to_message(OdometrySample(2, Pose2(), 0.0, 0.0), 'odom', 'base_link')
    assert isinstance(message, Odometry)
    assert message == empty
