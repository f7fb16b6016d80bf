"""fusion_node while it runs: its services, its live parameters, the gentle map to odom."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import SetBool, Trigger

from fusion_node.testing import ANCHORS, START, Fusion
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PoseSample
from tablerunner_interfaces.srv import SetPose
from tablerunner_ros.conversions.pose import pose_to_message
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.testing.probe import Probe


def pose_message(stamp: int, pose: Pose2, covariance: Any = None) -> PoseWithCovarianceStamped:
    """Return what a user gives, by default to half a metre."""
    given = np.diag([0.25, 0.25, 0.07]) if covariance is None else covariance
    return pose_to_message(PoseSample(stamp, pose, given), 'map')


def set_pose(fusion: Fusion, message: PoseWithCovarianceStamped) -> SetPose.Response:
    """Ask for another pose."""
    return fusion.probe.call(SetPose, 'set_pose', SetPose.Request(pose=message))


def toggle(fusion: Fusion, on: bool) -> SetBool.Response:
    """Ask for fusion on or off."""
    return fusion.probe.call(SetBool, 'toggle', SetBool.Request(data=on))


def transforms(fusion: Fusion) -> list[Pose2]:
    """Return all transforms map to odom so far."""
    found = []
    for message in fusion.tf:
        move = message.transforms[0].transform
        found.append(
            Pose2(move.translation.x, move.translation.y, heading_from_quaternion(move.rotation))
        )
    return found


def test_set_pose_overrides_what_was_believed(probe: Probe) -> None:
    """The answer says so, and the estimate is there at once with the covariance given."""
    fusion = Fusion(probe, start=Pose2(8.0, 8.0, -2.0), use_ranges=False)
    fusion.drive(0.0, 0.0, 5, ranges=False)
    assert fusion.error()[0] > 3.0
    answer = set_pose(fusion, pose_message(fusion.stamp, START))
    assert (answer.success, answer.message) == (True, 'started anew there')
    probe.wait_for(lambda: fusion.error()[0] < 1e-6, 'the new start')
    assert fusion.error()[1] < 1e-6
    assert fusion.settled().pose.covariance[0] == pytest.approx(0.25)
    fusion.taken('set_pose', 1)


def test_set_pose_malformed_is_refused_with_reason(fusion: Fusion) -> None:
    """Each fault comes back in words, is counted, and changes nothing."""
    now, far = fusion.stamp, Pose2(9.0, 9.0, 0.0)
    singular = np.ones((3, 3))
    for message, reason in [
        (pose_message(0, far), 'zero stamp'),
        (pose_message(now, Pose2(math.nan, 0.0, 0.0)), 'position is not finite'),
        (pose_message(now, far, np.diag([0.1, -0.1, 0.1])), 'covariance is not one'),
        (pose_message(now, far, np.diag([0.1, 0.0, 0.1])), 'variance not positive'),
        (pose_message(now, far, np.diag([0.1, 0.1, 9.0])), 'heading missing'),
        (pose_message(now, far, singular), 'covariance singular'),
        (pose_message(now - 5 * 10**9, far), 'older than the history'),
        (pose_message(now + 3600 * 10**9, far), 'stamp in the future'),
    ]:
        answer = set_pose(fusion, message)
        assert (answer.success, answer.message) == (False, reason)
        fusion.probe.wait_diagnostic('fusion_node: set_pose', f'refused: {reason}', '1')
    fusion.drive(0.0, 0.0, 2)
    assert fusion.error()[0] < 0.05


def test_set_pose_before_odometry_is_kept_for_it(probe: Probe) -> None:
    """Told before anything moves, the robot starts there."""
    fusion = Fusion(probe, start=None)
    answer = set_pose(fusion, pose_message(fusion.stamp, START))
    assert (answer.success, answer.message) == (True, 'kept until odometry comes')
    fusion.drive(0.0, 0.0, 2, ranges=False)
    assert fusion.error()[0] < 1e-6


def test_reset_begins_as_at_the_start(fusion: Fusion) -> None:
    """A robot that was set down at its start again is told so; anchors stay known."""
    fusion.drive(0.5, 0.2, 100)
    assert fusion.error()[0] < 0.05
    answer = fusion.probe.call(Trigger, 'reset', Trigger.Request())
    assert (answer.success, answer.message) == (True, 'no odometry yet')
    fusion.truth = START
    fusion.drive(0.0, 0.0, 10)
    assert fusion.error()[0] < 0.1
    assert fusion.innovations[-1].accepted


def test_toggle_lets_odometry_carry_the_pose_and_takes_ranges_back(fusion: Fusion) -> None:
    """Off: refused, told and counted, the covariance grows, health says so; on: as before."""
    probe = fusion.probe
    fusion.drive(0.5, 0.2, 50)
    before = fusion.settled().pose.covariance[0]
    probe.wait_for(lambda: len(fusion.innovations) == 25, 'the innovations')
    answer = toggle(fusion, False)
    assert (answer.success, answer.message) == (True, 'fusion is off: odometry alone')
    fusion.drive(0.5, 0.2, 100)
    assert fusion.settled().pose.covariance[0] > 1.2 * before
    assert fusion.error()[0] < 0.1  # odometry is exact here
    probe.wait_for(lambda: len(fusion.innovations) == 75, 'the refusals')
    assert {item.reason for item in fusion.innovations[25:]} == {'switched off'}
    fusion.refused('uwb/ranges', 'switched off (A0)', 13)
    status = probe.wait_diagnostic('fusion_node', 'pose by', 'switched off')
    assert (status.level, status.message[:28]) == (b'\x01', 'dead reckoning: switched off')
    assert toggle(fusion, True).message == 'fusion is on'
    fusion.drive(0.5, 0.2, 10)
    probe.wait_for(lambda: len(fusion.innovations) == 80, 'further innovations')
    assert all(item.accepted for item in fusion.innovations[75:])
    assert probe.wait_diagnostic('fusion_node', 'pose by', 'fused').level == b'\x00'


def test_silent_ranges_are_told_and_the_covariance_grows(fusion: Fusion) -> None:
    """Two seconds of odometry alone: a warning with the cause; ranges of one anchor: another."""
    probe = fusion.probe
    fusion.drive(0.5, 0.2, 50)
    before = fusion.settled().pose.covariance[0]
    fusion.drive(0.5, 0.2, 100, ranges=False)
    status = probe.wait_diagnostic('fusion_node', 'pose by', 'no measurements')
    assert status.level == b'\x01'
    assert status.message.startswith('dead reckoning: no measurements, for ')
    assert fusion.settled().pose.covariance[0] > 1.2 * before
    for _ in range(25):
        fusion.drive(0.5, 0.2, 2, ranges=False)
        fusion.send_range(ANCHORS[1])
    status = probe.wait_diagnostic('fusion_node', 'pose by', 'one anchor only')
    assert status.level == b'\x01'


def test_estimator_changed_while_it_runs_keeps_the_pose(fusion: Fusion) -> None:
    """Another one takes over at the same pose; innovations and diagnostics name it."""
    probe = fusion.probe
    fusion.drive(0.5, 0.2, 50)
    for name in ('ukf', 'ekf_cv', 'kf', 'dead_reckoning', 'ekf'):
        assert probe.set_parameter('fusion_node', 'estimator', name) == ''
        probe.wait_diagnostic('fusion_node', 'estimator', name)
        before = len(fusion.innovations)
        fusion.drive(0.5, 0.2, 20)
        assert fusion.error()[0] < 0.1
        probe.wait_for(lambda count=before: len(fusion.innovations) > count, 'an innovation')
        assert fusion.innovations[-1].estimator == name
    assert probe.set_parameter('fusion_node', 'estimator', 'magic') != ''


def test_transform_moves_gently_on_request_while_the_pose_does_not(probe: Probe) -> None:
    """After a correction of half a metre by a camera map to odom fades to it in about a second.

    The published poses are unsmoothed and jump; a parameter set back to zero ends it at once.
    """
    fusion = Fusion(probe, use_ranges=False, transform_smoothing=0.5)
    probe.speak(PoseWithCovarianceStamped, 'camera/pose')
    probe.connected('camera/pose')
    fusion.drive(0.0, 0.0, 5, ranges=False)
    fusion.settled()
    probe.wait_for(lambda: len(fusion.tf) == 5, 'the transforms')
    assert all(item.distance_to(START) < 1e-9 for item in transforms(fusion))
    moved = Pose2(START.x + 0.2, START.y, START.heading)
    probe.publish('camera/pose', pose_message(fusion.stamp, moved, np.eye(3) * 1e-6))
    probe.wait_for(lambda: fusion.innovations, 'its innovation')
    assert fusion.innovations[0].accepted
    jumped = fusion.settled().pose.pose.position.x - START.x
    assert jumped > 0.19
    fusion.drive(0.0, 0.0, 50, ranges=False)
    fusion.settled()
    probe.wait_for(lambda: len(fusion.tf) == 55, 'the transforms')
    gone = np.array([item.x - START.x for item in transforms(fusion)[5:]]) / jumped
    # 20 ms steps of a time constant of half a second, the first from the last transform on.
    assert gone == pytest.approx(1.0 - np.exp(-np.arange(1, 51) * 0.02 / 0.5), abs=1e-3)
    assert probe.set_parameter('fusion_node', 'transform_smoothing', 0.0) == ''
    fusion.drive(0.0, 0.0, 1, ranges=False)
    probe.wait_for(lambda: len(fusion.tf) == 56, 'one more transform')
    assert transforms(fusion)[-1].x - START.x == pytest.approx(jumped, abs=1e-9)
    # A new start is not approached, it is taken.
    assert probe.set_parameter('fusion_node', 'transform_smoothing', 5.0) == ''
    assert set_pose(fusion, pose_message(fusion.stamp, Pose2(8.0, 1.0, 2.0))).success
    fusion.drive(0.0, 0.0, 1, ranges=False)
    probe.wait_for(lambda: len(fusion.tf) == 57, 'one more transform')
    assert transforms(fusion)[-1].distance_to(Pose2(8.0, 1.0, 2.0)) < 1e-9
