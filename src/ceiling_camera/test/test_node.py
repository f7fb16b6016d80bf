"""ceiling_camera over DDS: poses of robots, and what it refuses."""

from __future__ import annotations

import time
from array import array
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image

from ceiling_camera.node import CeilingCameraNode
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Marker, RobotGeometry, Scenario
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.types import ImageSample, Lens
from tablerunner_ros.conversions.image import image_to_message, lens_to_message
from tablerunner_ros.conversions.pose import pose_from_message
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.testing.probe import Probe

IMAGES, INFO, POSES = 'camera/image_raw', 'camera/camera_info', 'camera/pose'
CAMERA = Camera(
    (1.0, 2.0, 3.2),
    width=320,
    height=240,
    focal=(230.0, 230.0),
    position_std=0.0,
    angle_std=0.0,
    focal_std=0.0,
)
LENS = Lens(320, 240, CAMERA.focal, CAMERA.middle, CAMERA.distortion)
MARKERS = {'one': (Marker(), 329.0), 'two': (Marker((30, 190, 60)), 131.0)}
POSE_ONE, POSE_TWO = Pose2(0.6, 2.3, 1.0), Pose2(1.4, 1.8, -2.0)


@pytest.fixture(scope='module')
def view() -> CeilingView:
    return CeilingView(Scenario('x', camera=CAMERA, robot=RobotGeometry()), 1)


class Eye:
    """A node in this process, and the probe that shows it pictures."""

    def __init__(self, probe: Probe, view: CeilingView, *robots: str, **parameters: Any) -> None:
        self.probe, self.view = probe, view
        robots = robots or ('one',)
        given = {
            'mount.position': list(CAMERA.position),
            'marker.robots': list(robots),
            'marker.hues': [MARKERS[robot][1] for robot in robots],
            'marker.heights': [1.15] * len(robots),
            **parameters,
        }
        self.node = probe.host(
            CeilingCameraNode,
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        )
        probe.speak(Image, IMAGES)
        probe.speak(CameraInfo, INFO)
        probe.connected(IMAGES)
        probe.connected(INFO)
        self.stamp = time.time_ns() - 60 * 10**9

    def picture(self, *poses: Pose2) -> Image:
        """Return a picture of robots one and two, later than the last."""
        self.stamp += 100_000_000
        robots = [
            RobotView(pose, 0.25, marker)
            for pose, (marker, _) in zip(poses, MARKERS.values(), strict=False)
        ]
        return image_to_message(
            ImageSample(self.stamp, self.view.draw(0.0, robots)), 'ceiling_camera'
        )

    def show_lens(self, lens: Lens = LENS) -> None:
        """Publish camera_info and wait until the node knows it."""
        self.probe.publish(INFO, lens_to_message(lens, self.stamp, 'ceiling_camera'))
        self.probe.wait_diagnostic(f'ceiling_camera: {INFO}', 'taken', '1')

    def refused(self, source: str, reason: str) -> None:
        """Wait until a refusal is on /diagnostics."""
        self.probe.wait_diagnostic(f'ceiling_camera: {source}', f'refused: {reason}', '1')


def test_picture_becomes_a_pose_with_the_stamp_of_the_exposure(
    probe: Probe, view: CeilingView
) -> None:
    """And the debug image shows it, for who asks."""
    eye = Eye(probe, view)
    poses = probe.listen(PoseWithCovarianceStamped, POSES)
    probe.heard(POSES)
    drawn = probe.listen(Image, 'camera/debug_image')
    probe.heard('camera/debug_image')
    eye.show_lens()
    picture = eye.picture(POSE_ONE)
    probe.publish(IMAGES, picture)
    message = probe.wait_for(lambda: poses, 'a pose')[0]
    sample = pose_from_message(message, 'map', POSES)
    assert sample.stamp == eye.stamp
    assert sample.pose.distance_to(POSE_ONE) < 0.002
    assert abs(sample.pose.heading - POSE_ONE.heading) < 0.02
    assert 1e-6 < sample.covariance[0, 0] < 1e-3
    image = probe.wait_for(lambda: drawn, 'a debug image')[0]
    assert stamp_from_message(image.header.stamp) == eye.stamp
    assert (image.encoding, len(image.data)) == ('bgr8', len(picture.data))
    assert bytes(image.data) != bytes(picture.data)


def test_two_robots_have_a_topic_each(probe: Probe, view: CeilingView) -> None:
    eye = Eye(probe, view, 'one', 'two', pose_topics=['a/camera/pose', 'b/camera/pose'])
    found: dict[str, list[Any]] = {'a': [], 'b': []}
    for name, messages in found.items():
        probe.node.create_subscription(
            PoseWithCovarianceStamped, f'{name}/camera/pose', messages.append, 10
        )
        probe.heard(f'{name}/camera/pose')
    eye.show_lens()
    probe.publish(IMAGES, eye.picture(POSE_ONE, POSE_TWO))
    probe.wait_for(lambda: found['a'] and found['b'], 'both poses')
    for messages, pose in zip(found.values(), (POSE_ONE, POSE_TWO), strict=True):
        sample = pose_from_message(messages[0], 'map', POSES)
        assert sample.pose.distance_to(pose) < 0.003


def test_what_cannot_be_used_is_refused_and_counted(probe: Probe, view: CeilingView) -> None:
    """Before the lens, without colour, cut off, too old, black, of another size, empty."""
    eye = Eye(probe, view)
    good = eye.picture(POSE_ONE)
    probe.publish(IMAGES, good)
    eye.refused(IMAGES, 'no camera_info yet')
    blind = lens_to_message(LENS, eye.stamp, 'ceiling_camera')
    blind.k = [0.0] * 9
    probe.publish(INFO, blind)
    eye.refused(INFO, 'camera is not calibrated')
    eye.show_lens()
    mono = eye.picture(POSE_ONE)
    mono.encoding = 'mono8'
    probe.publish(IMAGES, mono)
    eye.refused(IMAGES, 'encoding is not one of bgr8, rgb8, bgra8, rgba8')
    short = eye.picture(POSE_ONE)
    short.data = short.data[:-5000]
    probe.publish(IMAGES, short)
    eye.refused(IMAGES, 'data is not as long as step and height say')
    black = image_to_message(
        ImageSample(eye.stamp, np.zeros((240, 320, 3), np.uint8)), 'ceiling_camera'
    )
    probe.publish(IMAGES, black)
    eye.refused(IMAGES, 'picture is black')
    small = image_to_message(
        ImageSample(eye.stamp, np.zeros((120, 160, 3), np.uint8)), 'ceiling_camera'
    )
    probe.publish(IMAGES, small)
    eye.refused(IMAGES, 'picture is not of the size that camera_info says')
    eye.stamp += 10**12
    probe.publish(IMAGES, eye.picture(POSE_ONE))
    eye.refused(IMAGES, 'stamp in the future')
    eye.stamp -= 10**12
    probe.publish(IMAGES, eye.picture())
    eye.refused(f'{POSES}/one', 'no marker seen')


def test_doubtful_markers_of_one_robot_leave_the_other_alone(
    probe: Probe, view: CeilingView
) -> None:
    """Two of one colour, and one that the border cuts: no pose, a reason, and robot two's pose."""
    eye = Eye(probe, view, 'one', 'two', pose_topics=['a/camera/pose', 'b/camera/pose'])
    found: dict[str, list[Any]] = {'a': [], 'b': []}
    for name, messages in found.items():
        probe.node.create_subscription(
            PoseWithCovarianceStamped, f'{name}/camera/pose', messages.append, 10
        )
        probe.heard(f'{name}/camera/pose')
    eye.show_lens()
    markers = [marker for marker, _ in MARKERS.values()]
    cut = view.rays.slopes[120, -1] * (CAMERA.position[2] - markers[0].height)
    cut += CAMERA.position[:2]
    cases = {
        'two markers of one colour': [POSE_ONE, Pose2(0.4, 1.5, 1.0)],
        'marker at the border of the picture': [Pose2(*(float(part) for part in cut), 0.0)],
    }
    for count, (reason, ones) in enumerate(cases.items(), start=1):
        eye.stamp += 100_000_000
        robots = [RobotView(pose, 0.25, markers[0]) for pose in ones]
        robots.append(RobotView(POSE_TWO, 0.25, markers[1]))
        picture = ImageSample(eye.stamp, view.draw(0.0, robots))
        probe.publish(IMAGES, image_to_message(picture, 'ceiling_camera'))
        eye.refused(f'{POSES}/one', reason)
        probe.wait_for(lambda count=count: len(found['b']) == count, 'the pose of robot two')
        assert not found['a']


def test_white_and_torn_pictures_are_refused(probe: Probe, view: CeilingView) -> None:
    eye = Eye(probe, view)
    eye.show_lens()
    white = image_to_message(
        ImageSample(eye.stamp, np.full((240, 320, 3), 255, np.uint8)), 'ceiling_camera'
    )
    probe.publish(IMAGES, white)
    eye.refused(IMAGES, 'picture is white')
    torn = eye.picture(POSE_ONE)
    torn.data[200 * torn.step :] = array('B', bytes(40 * torn.step))
    probe.publish(IMAGES, torn)
    eye.refused(IMAGES, 'picture is torn')


def test_late_picture_keeps_the_stamp_of_its_exposure(probe: Probe, view: CeilingView) -> None:
    """It comes 0.3 s after its exposure and is used, at its time; an earlier one is not."""
    eye = Eye(probe, view)
    poses = probe.listen(PoseWithCovarianceStamped, POSES)
    probe.heard(POSES)
    eye.show_lens()
    eye.stamp = time.time_ns() - 400_000_000
    probe.publish(IMAGES, eye.picture(POSE_ONE))
    message = probe.wait_for(lambda: poses, 'a pose')[0]
    assert stamp_from_message(message.header.stamp) == eye.stamp
    assert time.time_ns() - eye.stamp > 300_000_000
    eye.stamp -= 250_000_000
    probe.publish(IMAGES, eye.picture(POSE_ONE))
    eye.refused(IMAGES, 'stamp does not advance')
    assert len(poses) == 1


def test_parameters_that_cannot_be_are_named(probe: Probe, view: CeilingView) -> None:
    with pytest.raises(ConfigError, match=r'marker\.heights\[0\].*below the camera'):
        Eye(probe, view, **{'marker.heights': [3.5]})


def test_topics_that_do_not_match_the_robots_are_named(probe: Probe, view: CeilingView) -> None:
    with pytest.raises(ConfigError, match=r'pose_topics.*1 topics'):
        Eye(probe, view, pose_topics=['a', 'b'])
