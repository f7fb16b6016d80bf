"""The node ceiling_camera: pictures to the pose of each robot that wears a marker."""

from __future__ import annotations

from typing import Any

import cv2
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import CameraInfo, Image

from ceiling_camera.params import CeilingCameraConfig
from tablerunner.errors import ConfigError
from tablerunner.types import ImageSample, Refusal
from tablerunner.vision import (
    UNSEEN,
    CeilingLocator,
    LocatorConfig,
    Observation,
    draw_overlay,
)
from tablerunner_ros.conversions.image import (
    image_from_message,
    image_to_message,
    lens_from_message,
)
from tablerunner_ros.conversions.pose import pose_to_message
from tablerunner_ros.diagnostics import WARN, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node
from tablerunner_ros.stamps import FUTURE, StampCheck, StampConfig

IMAGES, INFO, POSES, DEBUG = (
    'camera/image_raw',
    'camera/camera_info',
    'camera/pose',
    'camera/debug_image',
)


class CeilingCameraNode(Node):
    """Looks for every robot in each picture; poses carry the stamp of the exposure.

    The lens comes with camera_info; pictures before it are refused. What was seen is drawn into
    camera/debug_image while somebody listens to it.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('ceiling_camera', **options)
        config = declare_config(self, CeilingCameraConfig)
        self._map_frame = config.map_frame
        self._stamps = StampCheck(self, declare_config(self, StampConfig))
        self._settings = declare_config(self, LocatorConfig, on_change=self._configure)
        self._locator: CeilingLocator | None = None
        self._confidence: dict[str, float] = {}
        self._poses = self._publish_poses(config.pose_topics)
        self._debug = self.create_publisher(Image, DEBUG, qos_for(DEBUG))
        self._diagnostics = Diagnostics(self)
        self._diagnostics.watch(IMAGES, config.silence)
        self._diagnostics.watch(INFO)
        for robot in self._settings.marker.robots:
            self._diagnostics.watch(f'{POSES}/{robot}')
        self._diagnostics.describe(self._describe)
        self.create_subscription(CameraInfo, INFO, self._on_info, qos_for(INFO, subscriber=True))
        self.create_subscription(Image, IMAGES, self._on_image, qos_for(IMAGES, subscriber=True))

    def _publish_poses(self, topics: tuple[str, ...]) -> dict[str, Publisher]:
        robots = self._settings.marker.robots
        if topics and len(topics) != len(robots):
            raise ConfigError(
                'pose_topics', list(topics), f'{len(robots)} topics, as marker.robots has'
            )
        own = (POSES,) if len(robots) == 1 else tuple(f'{robot}/{POSES}' for robot in robots)
        return {
            robot: self.create_publisher(PoseWithCovarianceStamped, topic, qos_for(POSES))
            for robot, topic in zip(robots, topics or own, strict=True)
        }

    def _on_info(self, message: CameraInfo) -> None:
        lens = lens_from_message(message)
        if isinstance(lens, Refusal):
            self._diagnostics.refuse(lens)
            return
        self._diagnostics.take(INFO)
        if self._locator is None or self._locator.lens != lens:
            self._locator = CeilingLocator(self._settings, lens)

    def _on_image(self, message: Image) -> None:
        image = image_from_message(message)
        if isinstance(image, ImageSample) and self._stamps.is_future(image.stamp):
            image = Refusal(image.stamp, IMAGES, '', FUTURE)
        if isinstance(image, ImageSample) and self._locator is None:
            image = Refusal(image.stamp, IMAGES, '', 'no camera_info yet')
        if isinstance(image, Refusal) or self._locator is None:
            self._diagnostics.refuse(image)
            return
        found = self._locator.add(image)
        for item in found:
            if isinstance(item, Observation):
                message_out = pose_to_message(item.sample, self._map_frame)
                self._poses[item.robot].publish(message_out)
                self._diagnostics.take(f'{POSES}/{item.robot}', item.sample.stamp)
                self._confidence[item.robot] = item.sighting.confidence
            elif item.key:
                # A robot may well be where the camera does not see it.
                stream = Refusal(item.stamp, f'{POSES}/{item.key}', '', item.reason)
                self._diagnostics.refuse(stream, expected=item.reason == UNSEEN)
            else:
                self._diagnostics.refuse(item)
        if not any(isinstance(item, Refusal) and not item.key for item in found):
            self._diagnostics.take(IMAGES, image.stamp)
        if self._debug.get_subscription_count():
            drawn = draw_overlay(image.pixels, self._locator.camera, self._settings.marker, found)
            self._debug.publish(
                image_to_message(ImageSample(image.stamp, drawn), message.header.frame_id)
            )

    def _configure(self, config: LocatorConfig) -> None:
        self._settings = config
        if self._locator is not None:
            self._locator.configure(config)

    def _describe(self, report: Report) -> None:
        if self._locator is None:
            report.add(WARN, 'no camera_info yet: pictures cannot be used')
        for robot, confidence in self._confidence.items():
            report.values[f'confidence of {robot}'] = f'{confidence:.2f}'


def main() -> int:
    """Run the node until it is told to end."""
    # A picture takes a few milliseconds: threads of OpenCV would only take cores from others.
    cv2.setNumThreads(1)
    return spin_node(CeilingCameraNode)
