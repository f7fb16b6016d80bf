"""Every fault that data can have, among good data, given to the fusion_node process over DDS."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from fusion_node.testing import ANCHORS, NAN, Fusion
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, OdometrySample, PoseSample
from tablerunner_interfaces.srv import SetPose
from tablerunner_ros.conversions.anchors import anchors_to_message
from tablerunner_ros.conversions.odometry import odometry_to_message
from tablerunner_ros.conversions.pose import pose_to_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes

INF = math.inf
LIMIT_S = 40.0
HOUR = 3600 * 10**9
FAR = Pose2(9.0, 9.0, 0.0)
SINGULAR = [1.0 if row in (0, 1, 6, 7, 35) else 0.0 for row in range(36)]
ASKEW = [0.1 if row in (0, 7, 35) else 0.05 if row == 1 else 0.0 for row in range(36)]


def odometry(fusion: Fusion, change: Callable[[Odometry], object]) -> None:
    """Publish the odometry that would be next, spoilt."""
    message = odometry_to_message(
        OdometrySample(fusion.stamp + 10_000_000, fusion.odom, 0.5, 0.2, np.eye(3) * 1e-4),
        'odom',
        'base_link',
    )
    change(message)
    fusion.probe.publish('odom', message)


def with_pose(fusion: Fusion, topic: str, change: Callable[[Any], object]) -> None:
    """Publish a pose far from the robot, spoilt: nothing of it may be used."""
    message = pose_to_message(PoseSample(fusion.stamp, FAR, np.eye(3) * 1e-4), 'map')
    change(message)
    fusion.probe.publish(topic, message)


def variance(message: Any, index: int, value: float) -> None:
    """Set one number of a message's covariance of the pose."""
    values = list(message.pose.covariance)
    values[index] = value
    message.pose.covariance = values


def all_of(message: Any, values: list[float]) -> None:
    """Set a message's covariance of the pose."""
    message.pose.covariance = values


def twist(message: Any, value: float) -> None:
    """Set the variance of the speed."""
    values = list(message.twist.covariance)
    values[0] = value
    message.twist.covariance = values


def place(message: Any, **values: float) -> None:
    """Set coordinates of a pose."""
    for name, value in values.items():
        setattr(message.pose.pose.position, name, value)


def turn(message: Any, w: float) -> None:
    """Set one part of a quaternion."""
    message.pose.pose.orientation.w = w


def speed(message: Any, value: float) -> None:
    """Set the forward speed."""
    message.twist.twist.linear.x = value


def at(message: Any, seconds: int) -> None:
    """Set the stamp."""
    message.header.stamp.sec, message.header.stamp.nanosec = seconds, 0


Change = Callable[[Any], object]

ODOMETRY: list[tuple[str, Change]] = [
    ('covariance is not one', lambda m: variance(m, 0, NAN)),
    ('covariance is not one', lambda m: variance(m, 35, INF)),
    ('covariance is not one', lambda m: variance(m, 7, -1.0)),
    ('covariance is not one', lambda m: twist(m, NAN)),
    ('position is not finite', lambda m: place(m, x=NAN)),
    ('orientation is not finite', lambda m: turn(m, INF)),
    ('orientation is not a unit quaternion', lambda m: turn(m, 5.0)),
    ('velocity is not finite', lambda m: speed(m, -INF)),
    ('velocity too high', lambda m: speed(m, 1e300)),
    ('too far away', lambda m: place(m, y=1e300)),
    ('odometry jump', lambda m: place(m, x=500.0)),
    ('zero stamp', lambda m: at(m, 0)),
    ('older than the history', lambda m: at(m, 1)),
    ('stamp in the future', lambda m: at(m, 2**31 - 1)),
]
RANGES: list[tuple[str, int, dict[str, Any]]] = [
    ('range not finite', 0, {'range_m': NAN}),
    ('range not finite', 1, {'range_m': INF}),
    ('negative range', 0, {'range_m': -3.0}),
    ('too far away', 0, {'range_m': 1e300}),
    ('variance not positive', 0, {'variance_m2': INF}),
    ('variance not positive', 1, {'variance_m2': NAN}),
    ('variance not positive', 2, {'variance_m2': -1.0}),
    ('variance too small', 0, {'variance_m2': 1e-300}),
    ('variance too large', 0, {'variance_m2': 1e300}),
    ('nlos probability outside 0 to 1', 0, {'nlos_probability': 7.0}),
    ('zero stamp', 0, {'stamp': 0}),
    ('older than the history', 0, {'stamp': 10**9}),
    ('stamp in the future', 0, {'stamp': 2 * 10**18}),
    ('beyond the gate', 3, {'range_m': 40.0}),
]
POSES: list[tuple[str, str, Change]] = [
    ('camera/pose', 'covariance singular', lambda m: all_of(m, SINGULAR)),
    ('camera/pose', 'covariance not symmetric', lambda m: all_of(m, ASKEW)),
    ('camera/pose', 'covariance is not one', lambda m: variance(m, 0, INF)),
    ('camera/pose', 'variance not positive', lambda m: all_of(m, [0.0] * 36)),
    ('camera/pose', 'variance too large', lambda m: variance(m, 7, 1e300)),
    ('camera/pose', 'orientation is not finite', lambda m: turn(m, NAN)),
    ('camera/pose', 'too far away', lambda m: place(m, x=-1e300)),
    ('camera/pose', 'older than the history', lambda m: at(m, 1)),
    ('camera/pose', 'beyond the gate', lambda m: m),
    ('initialpose', 'covariance singular', lambda m: all_of(m, SINGULAR)),
    ('initialpose', 'variance too large', lambda m: variance(m, 0, 1e300)),
    ('initialpose', 'stamp in the future', lambda m: at(m, 2**31 - 1)),
]


def all_faults() -> list[tuple[str, str, Callable[[Fusion], object]]]:
    """Return stream and reason of each fault, and what sends it."""
    found: list[tuple[str, str, Callable[[Fusion], object]]] = []
    for reason, change in ODOMETRY:
        found.append(('odom', reason, partial(odometry, change=change)))
    for reason, index, changes in RANGES:
        anchor = ANCHORS[index]
        send = partial(send_range, anchor=anchor, **changes)
        found.append(('uwb/ranges', f'{reason} ({anchor.anchor_id})', send))
    found.append(
        ('uwb/ranges', 'unknown anchor (B7)', partial(send_range, anchor=Anchor('B7', (1, 1, 2))))
    )
    for topic, reason, change in POSES:
        found.append((topic, reason, partial(with_pose, topic=topic, change=change)))
    broken = Anchor('A0', (NAN, 0.0, 2.0))
    found.append(('uwb/anchors', 'anchor is not finite (A0)', partial(send_anchors, one=broken)))
    return found


def send_range(fusion: Fusion, anchor: Anchor, **changes: Any) -> None:
    """Publish a range, by default of an instant that no other has."""
    fusion.send_range(anchor, **{'stamp': fusion.stamp - 1, **changes})


def send_anchors(fusion: Fusion, one: Anchor) -> None:
    """Publish other anchors, a single one."""
    fusion.probe.publish('uwb/anchors', anchors_to_message((one,), fusion.stamp, 'map'))


def counts(fusion: Fusion, source: str, reason: str) -> bool:
    """Whether a refusal has been seen on /diagnostics."""
    status = fusion.probe.diagnostic(f'fusion_node: {source}')
    return status is not None and any(
        item.key == f'refused: {reason}' and int(item.value) > 0 for item in status.values
    )


def inject(fusion: Fusion) -> None:
    """Send each fault between good data until /diagnostics counts its reason.

    Topics are best effort and queues short: on a slow machine a message may be lost, and is sent
    again.
    """
    left = all_faults()
    end = time.monotonic() + LIMIT_S
    while left and time.monotonic() < end:
        for _, _, send in left:
            send(fusion)
            fusion.probe.spin(0.005)
            fusion.drive(0.5, 0.2, 2)
        seen = time.monotonic() + 2.0  # the process reports once a second
        while left and time.monotonic() < seen:
            fusion.probe.spin(0.05)
            left = [item for item in left if not counts(fusion, *item[:2])]
    assert not left, f'never counted: {[item[:2] for item in left]}'


def goes_by(fusion: Fusion, cause: str) -> Any:
    """Wait until the node's own status names what carries the pose; return it.

    Its time is that of the data: while none comes the status stays.
    """
    return fusion.probe.wait_diagnostic('fusion_node', 'pose by', cause)


def arrive(fusion: Fusion) -> Odometry:
    """Return the estimate of now; drive a step on when the last one was lost."""

    def now() -> Odometry | None:
        nonlocal patience
        if time.monotonic() > patience:
            patience = time.monotonic() + 0.5
            fusion.drive(0.0, 0.0, 1, ranges=False)
        newest = fusion.filtered[-1] if fusion.filtered else None
        stamp = newest.header.stamp if newest is not None else None
        same = stamp is not None and stamp.sec * 10**9 + stamp.nanosec == fusion.stamp
        return newest if same else None

    patience = time.monotonic() + 0.5
    return fusion.probe.wait_for(now, 'an estimate of now')


def assert_all_finite(fusion: Fusion) -> None:
    """No number that was published is NaN or infinite, but those that say so."""
    for message in [*fusion.filtered, *fusion.poses]:
        pose = message.pose.pose
        numbers = [pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w]
        assert np.isfinite([*numbers, *message.pose.covariance]).all()
        covariance = np.reshape(message.pose.covariance, (6, 6))
        assert np.abs(covariance - covariance.T).max() <= 1e-9 * max(covariance.max(), 1e-9)
    for message in fusion.filtered:
        speeds = [message.twist.twist.linear.x, message.twist.twist.angular.z]
        assert np.isfinite([*speeds, *message.twist.covariance]).all()
    for message in fusion.tf:
        move = message.transforms[0].transform
        numbers = [move.translation.x, move.translation.y, move.rotation.z, move.rotation.w]
        assert np.isfinite(numbers).all()
    for message in fusion.innovations:
        assert np.isfinite([*message.innovation, *message.variance]).all()
        assert math.isfinite(message.nis) or not message.accepted
        assert message.accepted or message.reason


@pytest.mark.timeout(180)
def test_fusion_process_lives_through_every_fault_and_says_what_happened(
    probe: Probe, processes: Processes
) -> None:
    """Faults of single messages, then of whole streams; in the end the robot is followed again."""
    fusion = Fusion(probe, processes=processes)
    probe.speak(PoseWithCovarianceStamped, 'camera/pose')
    probe.connected('camera/pose')
    probe.wait_for(lambda: fusion.drive(0.5, 0.2, 5) or fusion.innovations, 'an innovation')
    fusion.drive(0.5, 0.2, 50)
    arrive(fusion)
    assert fusion.error()[0] < 0.1

    inject(fusion)
    broken = pose_to_message(PoseSample(fusion.stamp, FAR, np.eye(3)), 'map')
    all_of(broken, SINGULAR)
    answer = probe.call(SetPose, 'set_pose', SetPose.Request(pose=broken))
    assert (answer.success, answer.message) == (False, 'covariance singular')
    fusion.drive(0.5, 0.2, 50)
    arrive(fusion)
    assert fusion.error()[0] < 0.2

    # All anchors blocked at once.
    fusion.drive(0.5, 0.2, 130, nlos_probability=1.0)
    status = goes_by(fusion, 'all anchors blocked')
    assert (status.level, status.message) == (b'\x01', 'dead reckoning: all anchors blocked')
    # One anchor only.
    for _ in range(60):
        fusion.drive(0.5, 0.2, 2, ranges=False)
        fusion.send_range(ANCHORS[2])
    assert goes_by(fusion, 'one anchor only').level == b'\x01'
    # Every anchor silent for a minute, at ten odometry messages a second.
    before = arrive(fusion).pose.covariance[0]
    fusion.drive(0.2, 0.1, 600, ranges=False, step_s=0.1)
    status = goes_by(fusion, 'no measurements')
    assert status.message.startswith('dead reckoning: no measurements, for ')
    assert arrive(fusion).pose.covariance[0] > 2.0 * before
    # A sensor at ten times its rate: 250 ranges a second.
    for _ in range(30):
        fusion.drive(0.5, 0.2, 1, ranges=False)
        for count in range(5):
            fusion.send_range(ANCHORS[count % 4], stamp=fusion.stamp - count * 4_000_000)
        probe.spin(0.01)

    fusion.drive(0.5, 0.2, 150)
    arrive(fusion)
    assert fusion.error()[0] < 0.1
    assert goes_by(fusion, 'fused').message == 'tracking'
    assert_all_finite(fusion)
    assert fusion.process is not None
    assert fusion.process.running
    assert fusion.process.end() == 0
    assert 'Traceback' not in fusion.process.output
