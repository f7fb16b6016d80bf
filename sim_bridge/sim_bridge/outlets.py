"""The topics of the simulation: those of the room, and those of each robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, MagneticField, Range

from sim_bridge.convert import contact_to_message, people_to_message, truth_to_message
from sim_bridge.params import BridgeConfig
from tablerunner.scenario import Scenario
from tablerunner.simulation import Contact, PersonState, Sample, Truth
from tablerunner.types import (
    ExchangeSample,
    ImageSample,
    ImuSample,
    Lens,
    MagneticSample,
    UltrasonicSample,
    WheelSample,
)
from tablerunner_interfaces.msg import UwbExchange
from tablerunner_ros.conversions.exchange import exchange_to_message
from tablerunner_ros.conversions.image import image_to_message, lens_to_message
from tablerunner_ros.conversions.imu import imu_to_message, magnetic_to_message
from tablerunner_ros.conversions.stamp import fill_stamp
from tablerunner_ros.conversions.ultrasonic import ultrasonic_to_message
from tablerunner_ros.conversions.wheels import wheels_to_message
from tablerunner_ros.qos import qos_for


class RoomOutlets:
    """Publishers of what all robots share: the time, people, the camera's pictures.

    Parameters
    ----------
    node : rclpy.node.Node
    config : BridgeConfig
    scenario : Scenario
        A camera's pictures come with its lens as it was measured, not as it is.
    """

    def __init__(self, node: Node, config: BridgeConfig, scenario: Scenario) -> None:
        self._config = config
        topic = _topics(node, '')
        self._clock = topic(Clock, 'clock')
        self._people = topic(PoseArray, 'people')
        camera = scenario.camera
        if camera is not None:
            self._lens = Lens(
                camera.width, camera.height, camera.focal, camera.middle, camera.distortion
            )
            self._images = topic(Image, 'camera/image_raw')
            self._infos = topic(CameraInfo, 'camera/camera_info')

    def publish_clock(self, now_ns: int) -> None:
        """Publish the simulated time."""
        message = Clock()
        fill_stamp(message.clock, now_ns)
        self._clock(message)

    def publish_people(self, now_ns: int, people: Iterable[PersonState]) -> None:
        """Publish where everybody is."""
        self._people(people_to_message(now_ns, people, self._config.map_frame))

    def publish_picture(self, picture: ImageSample) -> None:
        """Publish a picture of the room's camera."""
        frame = self._config.camera_frame
        self._infos(lens_to_message(self._lens, picture.stamp, frame))
        self._images(image_to_message(picture, frame))


class RobotOutlets:
    """Publishers of one robot.

    Parameters
    ----------
    node : rclpy.node.Node
    config : BridgeConfig
    scenario : Scenario
        As this robot has it. Its ultrasonic sensors have a topic each, ``ultrasonic/NAME``; what
        its tag ranges is on ``uwb/exchanges``, what people's tags range on ``person/exchanges``.
    prefix : str
        Before each topic: the robot's namespace with a slash; '' for the only robot.
    """

    def __init__(
        self, node: Node, config: BridgeConfig, scenario: Scenario, prefix: str = ''
    ) -> None:
        self._config = config
        self._tag_id = scenario.tag_id
        topic = _topics(node, prefix)
        self._exchanges = topic(UwbExchange, 'uwb/exchanges')
        if scenario.robot.anchors:
            self._worn = topic(UwbExchange, 'person/exchanges')
        wheels = topic(JointState, 'joint_states')
        imu = topic(Imu, 'imu/data')
        magnetic = topic(MagneticField, 'imu/mag')
        truth = topic(Odometry, 'ground_truth')
        contacts = topic(DiagnosticStatus, 'contacts')
        sonars = {
            mount.frame: topic(Range, f'ultrasonic/{mount.name}')
            for mount in scenario.robot.ultrasonics
        }
        joints = (config.left_joint, config.right_joint)
        frames = (config.map_frame, config.base_frame)
        self._by_type: dict[type[Any], Callable[[Any], None]] = {
            ExchangeSample: self._publish_exchange,
            WheelSample: lambda s: wheels(wheels_to_message(s, *joints)),
            ImuSample: lambda s: imu(imu_to_message(s, config.imu_frame)),
            MagneticSample: lambda s: magnetic(magnetic_to_message(s, config.imu_frame)),
            UltrasonicSample: lambda s: sonars[s.sensor](ultrasonic_to_message(s)),
            Truth: lambda s: truth(truth_to_message(s, *frames)),
            Contact: lambda s: contacts(contact_to_message(s)),
        }

    def publish_samples(self, samples: Sequence[Sample]) -> None:
        """Publish each sample that has a topic."""
        for sample in samples:
            publish = self._by_type.get(type(sample))
            if publish is not None:
                publish(sample)

    def _publish_exchange(self, sample: ExchangeSample) -> None:
        if sample.tag_id == self._tag_id:
            self._exchanges(exchange_to_message(sample, self._config.tag_frame))
        else:
            self._worn(exchange_to_message(sample, sample.tag_id))


def _topics(node: Node, prefix: str) -> Callable[[type[Any], str], Callable[[Any], None]]:
    """Return a maker of publishers of the contract's topics, by their relative names."""

    def topic(type_: type[Any], name: str) -> Callable[[Any], None]:
        publish: Callable[[Any], None] = node.create_publisher(
            type_, f'{prefix}{name}', qos_for(name)
        ).publish
        return publish

    return topic
