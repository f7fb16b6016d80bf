"""Records that only the simulation has, as messages; pure functions."""

from __future__ import annotations

import math
from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose, PoseArray, TransformStamped
from nav_msgs.msg import Odometry

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import RobotGeometry
from tablerunner.simulation import Contact, PersonState, Truth
from tablerunner_ros.conversions.stamp import fill_stamp
from tablerunner_ros.transforms import transform_message


def truth_to_message(truth: Truth, frame: str, child: str) -> Odometry:
    """Return the truth as odometry; its covariance of zero says that it is exact."""
    message = Odometry()
    fill_stamp(message.header.stamp, truth.stamp)
    message.header.frame_id = frame
    message.child_frame_id = child
    _fill_pose(message.pose.pose, truth.pose)
    message.twist.twist.linear.x = truth.linear_m_s
    message.twist.twist.angular.z = truth.angular_rad_s
    return message


def people_to_message(stamp: int, people: Iterable[PersonState], frame: str) -> PoseArray:
    """Return where everybody stands and looks, in the order of the scenario."""
    message = PoseArray()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    for person in people:
        pose = Pose()
        _fill_pose(pose, person.pose)
        message.poses.append(pose)
    return message


def contact_to_message(contact: Contact) -> DiagnosticStatus:
    """Return a touch as a status: ERROR where the robot is to blame, else WARN."""
    level = DiagnosticStatus.ERROR if contact.robot_at_fault else DiagnosticStatus.WARN
    words = 'the robot hit' if contact.robot_at_fault else 'the robot was touched by'
    values = {
        'stamp [ns]': str(contact.stamp),
        'kind': contact.kind,
        'name': contact.name,
        'robot at fault': str(contact.robot_at_fault).lower(),
        'closing speed [m/s]': f'{contact.closing_m_s:.3f}',
        'x [m]': f'{contact.pose.x:.3f}',
        'y [m]': f'{contact.pose.y:.3f}',
    }
    return DiagnosticStatus(
        level=level,
        name='contact',
        message=f'{words} {contact.name}',
        hardware_id='simulation',
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def mounts_to_transforms(
    robot: RobotGeometry, base: str, imu: str, tag: str, stamp: int
) -> list[TransformStamped]:
    """Return where each sensor sits on the robot."""
    places = [
        (imu, Pose2(*robot.imu_position[:2]), robot.imu_position[2]),
        (tag, Pose2(*robot.tag_position[:2]), robot.tag_position[2]),
    ]
    places += [(mount.frame, mount.pose, robot.ultrasonic_height) for mount in robot.ultrasonics]
    transforms = []
    for frame, pose, height in places:
        transform = transform_message(stamp, base, frame, pose)
        transform.transform.translation.z = height
        transforms.append(transform)
    return transforms


def _fill_pose(message: Pose, pose: Pose2) -> None:
    message.position.x = pose.x
    message.position.y = pose.y
    message.orientation.z = math.sin(0.5 * pose.heading)
    message.orientation.w = math.cos(0.5 * pose.heading)
