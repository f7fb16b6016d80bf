"""fusion_node over DDS: the pose it believes, when it believes it, and what it refuses."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import MagneticField

from fusion_node.node import FusionNode
from fusion_node.testing import ANCHORS, START, Fusion
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import MagneticSample, OdometrySample, PoseSample
from tablerunner_interfaces.msg import UwbAnchorArray
from tablerunner_ros.conversions.anchors import anchors_to_message
from tablerunner_ros.conversions.imu import magnetic_to_message
from tablerunner_ros.conversions.odometry import odometry_from_message, odometry_to_message
from tablerunner_ros.conversions.pose import pose_from_message, pose_to_message
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes

NAN = math.nan


def test_fusion_of_odometry_and_ranges_is_where_the_robot_is(fusion: Fusion) -> None:
    """Position, heading and speed; pose says the same as odometry/filtered."""
    fusion.drive(0.5, 0.2, 100)
    position, heading = fusion.error()
    assert position < 0.05
    assert heading < 0.05
    message = fusion.settled()
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'base_link')
    assert message.twist.twist.linear.x == pytest.approx(0.5)
    assert 0.0 < message.pose.covariance[0] < 0.05
    fusion.probe.wait_for(lambda: len(fusion.poses) == len(fusion.filtered), 'the poses')
    assert fusion.poses[-1].header == fusion.filtered[-1].header
    assert fusion.poses[-1].pose == fusion.filtered[-1].pose


def test_fusion_transform_leads_from_map_to_the_robot(fusion: Fusion) -> None:
    """Map to odom, followed by odom to base_link, is the pose in the map."""
    fusion.drive(0.5, 0.2, 50)
    fusion.settled()
    fusion.probe.spin(0.1)
    transform = fusion.tf[-1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ('map', 'odom')
    move = transform.transform
    map_to_odom = Pose2(
        move.translation.x, move.translation.y, heading_from_quaternion(move.rotation)
    )
    stamp = stamp_from_message(transform.header.stamp)
    assert stamp == fusion.stamp
    pose = map_to_odom @ fusion.odom
    assert pose.distance_to(fusion.truth) < 0.05


def test_fusion_innovations_tell_of_each_range(fusion: Fusion) -> None:
    """Innovation, variance, NIS and gate; an outlier is refused at the gate and says so."""
    fusion.drive(0.5, 0.2, 50)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 25, '25 innovations')
    last = fusion.innovations[-1]
    assert (last.source, last.estimator, last.accepted) == ('uwb/ranges', 'ekf', True)
    assert last.key in {anchor.anchor_id for anchor in ANCHORS}
    assert last.nis == pytest.approx(last.innovation[0] ** 2 / last.variance[0])
    assert last.nis < last.gate
    before = fusion.settled()
    fusion.stamp += 1_000_000
    fusion.send_range(ANCHORS[0], range_m=fusion.distance(ANCHORS[0]) + 3.0)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 26, 'the outlier')
    outlier = fusion.innovations[-1]
    assert not outlier.accepted
    assert outlier.reason == 'beyond the gate'
    assert outlier.innovation[0] == pytest.approx(3.0, abs=0.1)
    after = fusion.settled()
    assert after.pose.pose.position.x == pytest.approx(before.pose.pose.position.x, abs=0.01)
    fusion.refused('uwb/ranges', 'beyond the gate (A0)')


def test_fusion_unknown_start_is_not_confident_before_it_is_known(probe: Probe) -> None:
    """At rest ranges say nothing of heading: no transform, a wide heading; driving finds it."""
    fusion = Fusion(probe, start=None)
    fusion.drive(0.0, 0.0, 60)
    fusion.probe.wait_for(lambda: fusion.poses, 'a pose')
    pose = fusion.poses[-1].pose
    assert pose.covariance[35] > 1.0
    assert math.hypot(pose.pose.position.x - START.x, pose.pose.position.y - START.y) < 0.5
    assert fusion.tf == []
    status = fusion.probe.wait_diagnostic('fusion_node', 'state', 'aligning')
    assert status.level == b'\x01'
    assert 'drive' in status.message
    fusion.drive(0.5, 0.5, 300)
    position, heading = fusion.error()
    assert position < 0.1
    assert heading < 0.1
    assert fusion.settled().pose.covariance[35] < 0.05
    fusion.probe.wait_for(lambda: fusion.tf, 'map to odom')
    fusion.probe.wait_diagnostic('fusion_node', 'state', 'tracking')


def test_fusion_state_says_when_it_is_lost_and_found(fusion: Fusion) -> None:
    """A robot that was carried off: at each change, and to those who come late."""
    states = fusion.probe.listen(DiagnosticStatus, 'fusion_state')

    def heard(index: int) -> list[str]:
        return [status.values[index].value for status in states]

    fusion.drive(0.5, 0.2, 50)
    fusion.probe.wait_for(lambda: heard(0)[-1:] == ['tracking'], 'tracking')
    fusion.truth = Pose2(7.0, 7.0, -2.0)
    fusion.drive(0.5, 0.2, 300)
    fusion.probe.wait_for(lambda: 'lost' in heard(0), 'lost')
    told = next(status for status in states if status.values[0].value == 'lost')
    assert (told.name, told.level) == ('fusion_node', DiagnosticStatus.ERROR)
    fusion.drive(0.5, 0.2, 400)
    fusion.probe.wait_for(lambda: heard(0)[-1] == 'tracking', 'tracking again')
    assert heard(1)[-1]  # what carries it
    assert len(states) < 12  # changes only
    assert fusion.error()[0] < 0.1


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda f: f.send_range(ANCHORS[0], stamp=0), 'zero stamp (A0)'),
        (
            lambda f: f.send_range(ANCHORS[0], stamp=time.time_ns() + 5 * 10**9),
            'stamp in the future (A0)',
        ),
        (lambda f: f.send_range(ANCHORS[0], range_m=NAN), 'range not finite (A0)'),
        (lambda f: f.send_range(ANCHORS[0], range_m=-1.0), 'negative range (A0)'),
        (lambda f: f.send_range(ANCHORS[0], variance_m2=-1.0), 'variance not positive (A0)'),
        (lambda f: f.send_range(ANCHORS[0], variance_m2=NAN), 'variance not positive (A0)'),
        (lambda f: f.send_range(ANCHORS[0], anchor_id='A9'), 'unknown anchor (A9)'),
        (
            lambda f: f.send_range(ANCHORS[0], stamp=f.stamp - 5 * 10**9),
            'older than the history (A0)',
        ),
        (
            lambda f: f.send_range(ANCHORS[0], stamp=f.stamp + 5 * 10**8),
            'ahead of odometry (A0)',
        ),
    ],
)
def test_fusion_bad_range_is_refused_and_counted(
    fusion: Fusion, spoil: Callable[[Fusion], None], reason: str
) -> None:
    """The estimate stays, the reason stands on /diagnostics, and good ranges go on.

    The refusal is on innovations too, with the anchor and without any number.
    """
    fusion.drive(0.5, 0.2, 20)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 10, 'the good ones before it')
    spoil(fusion)
    fusion.refused('uwb/ranges', reason)
    last = fusion.probe.wait_for(lambda: fusion.innovations[10:], 'its innovation')[0]
    assert f'{last.reason} ({last.key})' == reason
    assert (last.source, last.accepted) == ('uwb/ranges', False)
    assert (len(last.innovation), len(last.variance)) == (0, 0)
    assert math.isnan(last.nis)
    fusion.drive(0.5, 0.2, 10)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 16, 'further ranges')
    assert all(item.accepted for item in fusion.innovations[11:])
    assert fusion.error()[0] < 0.05


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda f: f.send_odometry(stamp=0), 'zero stamp'),
        (lambda f: f.send_odometry(stamp=time.time_ns() + 5 * 10**9), 'stamp in the future'),
        (lambda f: f.send_odometry(frame='map'), 'not in frame odom'),
        (lambda f: f.send_odometry(), 'repeated'),
        (lambda f: f.send_odometry(stamp=f.stamp - 5 * 10**9), 'older than the history'),
    ],
)
def test_fusion_bad_odometry_is_refused_and_counted(
    fusion: Fusion, spoil: Callable[[Fusion], None], reason: str
) -> None:
    """As for ranges."""
    fusion.drive(0.5, 0.2, 20)
    spoil(fusion)
    fusion.refused('odom', reason)
    fusion.drive(0.5, 0.2, 10)
    assert fusion.error()[0] < 0.05


def test_fusion_late_range_is_put_in_its_place(fusion: Fusion) -> None:
    """Half a second late, and used."""
    fusion.drive(0.5, 0.2, 50)
    stamp, distance = fusion.stamp, fusion.distance(ANCHORS[2])
    fusion.drive(0.5, 0.2, 25)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 38, 'those of the drive')
    fusion.send_range(ANCHORS[2], stamp=stamp + 1, range_m=distance)
    fusion.probe.wait_for(lambda: len(fusion.innovations) == 39, 'its innovation')
    late = fusion.innovations[-1]
    assert late.accepted
    assert stamp_from_message(late.header.stamp) == stamp + 1


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda f: f.send_start(Pose2(1.0, 1.0, 0.0), frame='odom'), 'not in frame map'),
        (lambda f: f.send_start(Pose2(NAN, 1.0, 0.0)), 'position is not finite'),
        (lambda f: f.send_start(Pose2(1.0, 1.0, NAN)), 'orientation is not finite'),
        (lambda f: f.send_start(Pose2(1.0, 1.0, 0.0), stamp=0), 'zero stamp'),
    ],
)
def test_fusion_malformed_initialpose_is_refused(
    fusion: Fusion, spoil: Callable[[Fusion], None], reason: str
) -> None:
    """The robot stays where it was believed to be."""
    spoil(fusion)
    fusion.refused('initialpose', reason)
    fusion.drive(0.0, 0.0, 2)
    assert fusion.error()[0] < 0.05


def test_fusion_initialpose_overrides_what_was_believed(probe: Probe) -> None:
    """A robot that was told a wrong start is told the right one."""
    fusion = Fusion(probe, start=Pose2(8.0, 8.0, -2.0), use_ranges=False)
    fusion.drive(0.0, 0.0, 5, ranges=False)
    assert fusion.error()[0] > 3.0
    fusion.send_start(START)
    probe.wait_for(lambda: fusion.error()[0] < 1e-6, 'the new start')
    assert fusion.error()[1] < 1e-6


def test_fusion_pose_of_the_camera_is_used(probe: Probe) -> None:
    """A second source of location, with heading."""
    fusion = Fusion(probe, use_ranges=False)
    probe.speak(PoseWithCovarianceStamped, 'camera/pose')
    probe.connected('camera/pose')
    fusion.drive(0.0, 0.0, 5, ranges=False)
    moved = Pose2(START.x + 0.1, START.y, START.heading)
    sample = PoseSample(fusion.stamp, moved, np.eye(3) * 1e-4)
    probe.publish('camera/pose', pose_to_message(sample, 'map'))
    innovation = probe.wait_for(lambda: fusion.innovations, 'its innovation')[0]
    assert (innovation.source, innovation.accepted) == ('camera/pose', True)
    fusion.taken('camera/pose', 1)
    back = pose_from_message(fusion.poses[-1], 'map', 'pose')
    assert isinstance(back, PoseSample)
    assert back.pose.x > START.x + 0.05


def test_fusion_stream_that_begins_again_resets_and_is_reported(fusion: Fusion) -> None:
    """A bag that starts anew: the old estimate is dropped, all begins at the start again."""
    fusion.drive(0.5, 0.2, 100)
    fusion.settled()
    fusion.stamp -= 60 * 10**9
    fusion.truth, fusion.odom = START, Pose2()
    fusion.drive(0.0, 0.0, 10)
    fusion.refused('odom', 'time went back: started again')
    assert fusion.error()[0] < 0.2


def test_fusion_dead_reckoning_follows_odometry(probe: Probe) -> None:
    """`estimator:=dead_reckoning` ignores ranges."""
    fusion = Fusion(probe, estimator='dead_reckoning')
    fusion.send_odometry()
    fusion.settled()
    fusion.drive(0.5, 0.2, 50)
    assert fusion.error()[0] < 1e-3
    sample = odometry_from_message(fusion.settled())
    assert isinstance(sample, OdometrySample)
    assert probe.wait_diagnostic('fusion_node', 'estimator', 'dead_reckoning')


def test_fusion_parameter_changed_while_it_runs(fusion: Fusion) -> None:
    """A gate of nearly zero refuses from the next range on; bad values are refused."""
    probe = fusion.probe
    fusion.drive(0.5, 0.2, 20)
    assert probe.set_parameter('fusion_node', 'filter.gate', 1e-12) == ''
    probe.wait_for(lambda: len(fusion.innovations) == 10, 'the innovations of the drive')
    fusion.stamp += 1_000_000
    fusion.send_range(ANCHORS[0])
    probe.wait_for(lambda: len(fusion.innovations) == 11, 'an innovation')
    assert fusion.innovations[-1].gate == 1e-12
    assert not fusion.innovations[-1].accepted
    assert 'filter.gate: got 0.0' in probe.set_parameter('fusion_node', 'filter.gate', 0.0)
    assert 'read-only' in probe.set_parameter('fusion_node', 'history', 2.0)


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'estimator': 'magic'}, "estimator: got 'magic', expected one of"),
        ({'tag_position': [0.0]}, 'tag_position: got (0.0,), expected 3 numbers'),
        ({'filter.gate': -1.0}, 'filter.gate: got -1.0, expected a number above 0'),
        ({'pose_sources': ['moon']}, "pose_sources[0]: got 'moon', expected one of camera/pose"),
    ],
)
def test_fusion_bad_parameter_is_named(
    probe: Probe, parameters: dict[str, Any], words: str
) -> None:
    """The error names node, parameter, value and what was expected."""
    given = [Parameter(name, value=value) for name, value in parameters.items()]
    with pytest.raises(ConfigError, match=re.escape(f'parameters of /fusion_node: {words}')):
        FusionNode(context=probe.context, parameter_overrides=given)


def test_fusion_compass_is_heard_where_the_field_is_the_earths(probe: Probe) -> None:
    """A heading from imu/mag narrows the estimate's; a field bent by iron is refused by name."""
    robot = Fusion(probe, compass__use=True, compass__north=0.5, initial_pose_std=[0.1, 0.1, 0.3])
    probe.speak(MagneticField, 'imu/mag')
    probe.connected('imu/mag')
    robot.drive(0.5, 0.0, 3)
    probe.wait_for(lambda: robot.poses, 'a pose')
    for horizontal, reason in ((20e-6, ''), (40e-6, 'field not plausible')):
        told = len(robot.innovations)
        angle = 0.5 - START.heading
        field = (horizontal * math.cos(angle), horizontal * math.sin(angle), -44e-6)
        sample = MagneticSample(robot.stamp, *field)
        probe.publish('imu/mag', magnetic_to_message(sample, 'imu_link'))
        probe.wait_for(lambda told=told: len(robot.innovations) > told, 'an innovation')
        last = robot.innovations[-1]
        assert (last.source, last.accepted, last.reason) == ('imu/mag', not reason, reason)
    assert robot.poses[-1].pose.covariance[35] < 0.012  # 0.09 before, the heading's 0.01 beside it


def test_fusion_bad_parameter_file_exits_2_with_one_sentence(processes: Processes) -> None:
    """That error is all that the process says."""
    process = processes.node('fusion_node', 'fusion_node', {'filter': {'gate': -1.0}})
    assert process.wait() == 2
    assert len(process.output.splitlines()) == 1
    assert process.output.startswith(
        'parameters of /fusion_node: filter.gate: got -1.0, expected a number above 0'
    )


def test_fusion_process_works_and_ends_cleanly(probe: Probe, processes: Processes) -> None:
    """The installed executable, under simulated time that stands still."""
    process = processes.node(
        'fusion_node', 'fusion_node', {'initial_pose': [1, 2, 0], 'use_sim_time': True}
    )
    poses = probe.listen(PoseWithCovarianceStamped, 'pose')
    probe.speak(UwbAnchorArray, 'uwb/anchors')
    probe.publish('uwb/anchors', anchors_to_message(ANCHORS, 1, 'map'))
    stamps = iter(range(10**9, 10**12, 20_000_000))
    probe.repeat(
        'odom',
        lambda: odometry_to_message(
            OdometrySample(next(stamps), Pose2(), 0.0, 0.0), 'odom', 'base_link'
        ),
        lambda: poses,
        'a pose',
    )
    place = poses[-1].pose.pose.position
    assert (place.x, place.y) == (1.0, 2.0)
    # The clock has never been heard; /diagnostics comes all the same.
    probe.wait_diagnostic('fusion_node', 'state', 'tracking')
    assert process.end() == 0
    assert process.output == ''
