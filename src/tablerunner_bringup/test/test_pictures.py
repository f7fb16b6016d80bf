"""RViz' configuration and Foxglove's layout ask for what the nodes publish, type and all."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from ament_index_python.packages import get_package_share_directory
from rclpy.context import Context
from rclpy.parameter import Parameter

from ceiling_camera.node import CeilingCameraNode
from fusion_node.node import FusionNode
from nav_controller.node import NavNode
from nav_controller.safety_node import SafetyNode
from odom_node.frames_node import FramesNode
from odom_node.node import OdomNode
from sim_bridge.node import SimBridge
from tablerunner_bringup.message_types import message_class
from tablerunner_ros.qos import topic_qos
from tablerunner_ros.testing.domain import lease_domain
from uwb_driver.node import UwbDriver

BRINGUP = Path(__file__).parents[1]
SCENARIO = BRINGUP / 'scenarios' / 'bistro.yaml'  # the one with a camera
RVIZ = BRINGUP / 'rviz' / 'tablerunner.rviz'
FOXGLOVE = BRINGUP / 'foxglove' / 'tablerunner.json'

DISPLAYS = {
    'Odometry': 'nav_msgs/msg/Odometry',
    'PoseWithCovariance': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    'Path': 'nav_msgs/msg/Path',
    'PoseArray': 'geometry_msgs/msg/PoseArray',
    'Range': 'sensor_msgs/msg/Range',
    'SetInitialPose': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    'SetGoal': 'geometry_msgs/msg/PoseStamped',
}
"""What RViz' displays and tools read and write, by the last word of their class."""


class Contract:
    """The topics and services of all nodes, as the nodes themselves declare them."""

    def __init__(self) -> None:
        context = Context()
        scenario = Parameter('scenario', value=str(SCENARIO))
        with lease_domain() as domain:
            rclpy.init(args=[], context=context, domain_id=domain)
            nodes = [
                kind(context=context, parameter_overrides=[scenario] if needs else [])
                for kind, needs in (
                    (UwbDriver, False),
                    (OdomNode, False),
                    (FramesNode, False),
                    (CeilingCameraNode, False),
                    (FusionNode, False),
                    (NavNode, True),
                    (SafetyNode, True),
                    (SimBridge, True),
                )
            ]
            self.topics = dict(nodes[0].get_topic_names_and_types())
            self.published = {name for name in self.topics if nodes[0].count_publishers(name)}
            self.services = dict(nodes[0].get_service_names_and_types())
            for node in nodes:
                node.destroy_node()
            rclpy.shutdown(context=context)

    def type_of(self, topic: str) -> str:
        """Return the type of a topic, by its full name."""
        (found,) = self.topics[topic]
        return found


@pytest.fixture(scope='module')
def contract() -> Contract:
    """Return what the nodes of the room with a camera speak of."""
    return Contract()


@pytest.fixture(scope='module')
def layout() -> dict[str, Any]:
    """Return Foxglove's layout."""
    return json.loads(FOXGLOVE.read_text(encoding='utf-8'))


def test_rviz_displays_what_the_nodes_publish(contract: Contract) -> None:
    """A display of a topic that nobody publishes, or that asks for too much, stays empty."""
    manager = yaml.safe_load(RVIZ.read_text(encoding='utf-8'))['Visualization Manager']
    asked = [item for item in manager['Displays'] if 'Topic' in item]
    assert len(asked) >= 12
    for item in asked:
        topic = item['Topic']
        full = f'/{topic["Value"]}'
        assert full in contract.published, full
        assert contract.type_of(full) == DISPLAYS[item['Class'].partition('/')[2]], full
        offered = topic_qos(topic['Value'])
        assert offered.reliable or topic['Reliability Policy'] == 'Best Effort', full
        assert offered.latched or topic['Durability Policy'] == 'Volatile', full
    tools = [item for item in manager['Tools'] if 'Topic' in item]
    assert len(tools) == 2
    for item in tools:
        full = f'/{item["Topic"]["Value"]}'
        assert contract.type_of(full) == DISPLAYS[item['Class'].partition('/')[2]], full


def test_foxglove_shows_what_the_nodes_publish(contract: Contract, layout: dict[str, Any]) -> None:
    """Topics of the room, services of the buttons, what is clicked."""
    room = layout['configById']['3D!room']
    assert len(room['topics']) >= 12
    for topic in room['topics']:
        assert topic in contract.published, topic
    clicked = {
        'poseTopic': 'geometry_msgs/msg/PoseStamped',
        'poseEstimateTopic': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    }
    for key, type_ in clicked.items():
        assert contract.type_of(room['publish'][key]) == type_
    for name, panel in layout['configById'].items():
        if name.startswith('CallService!'):
            assert contract.services[panel['serviceName']] == ['std_srvs/srv/Trigger']
    image = layout['configById']['Image!camera']['imageMode']['imageTopic']
    assert contract.type_of(image) == 'sensor_msgs/msg/Image'
    diagnostics = layout['configById']['DiagnosticSummary!nodes']['topicToRender']
    assert contract.type_of(diagnostics) == 'diagnostic_msgs/msg/DiagnosticArray'


def test_foxglove_plots_fields_that_exist(contract: Contract, layout: dict[str, Any]) -> None:
    """Each path leads through fields of its topic's type to something that can be drawn."""
    paths = list(plotted(layout))
    assert len(paths) >= 10
    for path, method in paths:
        topic, _, fields = path.partition('.')
        assert topic in contract.published, path
        message = message_class(contract.type_of(topic))()
        assert method == 'receiveTime' or hasattr(message, 'header'), path
        value: Any = message
        for part in fields.split('.'):
            name, index = re.fullmatch(r'(\w+)(?:\[(\d+)\])?', part).groups()
            value = getattr(value, name)
            value = value if index is None else value[int(index)]
        assert isinstance(value, (float, str)), path


def test_foxglove_layout_places_each_panel_once(layout: dict[str, Any]) -> None:
    """A panel that is not placed is not seen, one without settings is empty."""
    assert sorted(placed(layout['layout'])) == sorted(layout['configById'])


def test_pictures_are_installed() -> None:
    """Where the documentation says that they are."""
    share = Path(get_package_share_directory('tablerunner_bringup'))
    assert (share / 'rviz' / RVIZ.name).is_file()
    assert (share / 'foxglove' / FOXGLOVE.name).is_file()


def plotted(layout: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the paths of all plots and transitions, with the time that they go by."""
    for name, panel in layout['configById'].items():
        if name.partition('!')[0] in ('Plot', 'StateTransitions'):
            for item in panel['paths']:
                yield item['value'], item['timestampMethod']


def placed(node: Any) -> Iterator[str]:
    """Yield the panels of a layout."""
    if isinstance(node, str):
        yield node
    else:
        yield from placed(node['first'])
        yield from placed(node['second'])
