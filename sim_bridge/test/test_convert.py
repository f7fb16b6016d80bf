"""Records of the simulation as messages."""

from __future__ import annotations

import math

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from sim_bridge.convert import (
    contact_to_message,
    mounts_to_transforms,
    people_to_message,
    truth_to_message,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import RobotGeometry
from tablerunner.simulation import Contact, PersonState, Truth


def heading_of(orientation: object) -> float:
    return 2 * math.atan2(orientation.z, orientation.w)


def test_truth_becomes_exact_odometry() -> None:
    truth = Truth(12_345_678_901, Pose2(1.0, 2.0, -0.7), 0.5, 0.1)
    message = truth_to_message(truth, 'map', 'base_link')
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 345_678_901)
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'base_link')
    assert (message.pose.pose.position.x, message.pose.pose.position.y) == (1.0, 2.0)
    assert heading_of(message.pose.pose.orientation) == pytest.approx(-0.7)
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == (0.5, 0.1)
    assert not message.pose.covariance.any()


def test_people_become_poses_in_their_order() -> None:
    people = [PersonState(str(i), Pose2(float(i), 0.0, 1.0), 0.8, 0.25) for i in range(3)]
    message = people_to_message(5, people, 'map')
    assert [pose.position.x for pose in message.poses] == [0.0, 1.0, 2.0]
    assert heading_of(message.poses[2].orientation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('at_fault', 'level'), [(True, DiagnosticStatus.ERROR), (False, DiagnosticStatus.WARN)]
)
def test_contact_level_tells_whose_fault_it_was(at_fault: bool, level: bytes) -> None:
    contact = Contact(7, 'person', 'guest', at_fault, 0.4, Pose2(1.0, 2.0, 0.0))
    message = contact_to_message(contact)
    values = {item.key: item.value for item in message.values}
    assert message.level == level
    assert 'guest' in message.message
    assert values['kind'] == 'person'
    assert values['robot at fault'] == str(at_fault).lower()
    assert values['stamp [ns]'] == '7'
    assert values['closing speed [m/s]'] == '0.400'


def test_mounts_become_the_frames_of_the_contract() -> None:
    robot = RobotGeometry()
    transforms = mounts_to_transforms(robot, 'base_link', 'imu_link', 'uwb_tag', 9)
    assert [item.child_frame_id for item in transforms] == [
        'imu_link',
        'uwb_tag',
        'ultrasonic_left',
        'ultrasonic_left_front',
        'ultrasonic_front',
        'ultrasonic_right_front',
        'ultrasonic_right',
    ]
    assert {item.header.frame_id for item in transforms} == {'base_link'}
    tag = transforms[1].transform.translation
    assert (tag.x, tag.y, tag.z) == robot.tag_position
    left = transforms[2].transform
    assert heading_of(left.rotation) == pytest.approx(math.pi / 2, abs=1e-5)
    assert left.translation.z == robot.ultrasonic_height
