"""docs/nodes.md against the parameters that the nodes declare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from tablerunner.config import Config
from tablerunner_ros import parameter_table
from tablerunner_ros.parameter_table import fill
from tablerunner_ros.parameters import fields_of
from tablerunner_ros.testing.domain import lease_domain

PAGE = Path(__file__).parents[2] / 'docs' / 'nodes.md'


def test_nodes_page_has_the_parameters_of_the_configs() -> None:
    """Made anew the page is the same; else run the command that stands at its top."""
    text = PAGE.read_text(encoding='utf-8')
    assert fill(text) == text, 'run: python3 -m tablerunner_ros.parameter_table docs/nodes.md'


@pytest.mark.parametrize(
    'name', ['uwb_driver', 'odom_node', 'sensor_frames', 'ceiling_camera', 'fusion_node']
)
def test_nodes_page_lists_all_that_a_node_declares(name: str) -> None:
    """The Configs named on the page are those the node declares, none forgotten."""
    from ceiling_camera.node import CeilingCameraNode
    from fusion_node.node import FusionNode
    from odom_node.frames_node import FramesNode
    from odom_node.node import OdomNode
    from uwb_driver.node import UwbDriver

    make: dict[str, type[Node]] = {
        'uwb_driver': UwbDriver,
        'odom_node': OdomNode,
        'sensor_frames': FramesNode,
        'ceiling_camera': CeilingCameraNode,
        'fusion_node': FusionNode,
    }
    section = PAGE.read_text(encoding='utf-8').split(f'\n## {name}\n')[1].split('\n## ')[0]
    listed = {
        line.split('`')[1]
        for line in section.partition('<!-- parameters')[2].splitlines()
        if line.startswith('| `')
    }
    context = Context()
    with lease_domain() as domain:
        rclpy.init(args=[], context=context, domain_id=domain)
        node = make[name](context=context)
        ros_own = {'use_sim_time', 'start_type_description_service'}
        declared = set(node.list_parameters([], 0).names) - ros_own
        node.destroy_node()
        rclpy.shutdown(context=context)
    assert declared == listed


def test_table_escapes_and_shows_each_kind() -> None:
    """A bar in a description does not end its cell; what must be given is marked."""
    from dataclasses import dataclass

    from tablerunner.config import parameter

    @dataclass(frozen=True)
    class Sample(Config):
        port: str = parameter(description='a | b')
        rate: float = parameter(2.0, description='A rate', unit='Hz', above=0.0, dynamic=True)
        names: tuple[str, ...] = parameter(('x', 'y'), description='Words')
        on: bool = parameter(True, description='A switch')

    rows: list[Any] = parameter_table.table([Sample]).splitlines()[2:]
    assert rows == [
        '| `port` | string | **required** |  |  |  | a \\| b |',
        '| `rate` | double | 2 | Hz | above 0 | yes | A rate |',
        '| `names` | string[] | [x, y] |  |  |  | Words |',
        '| `on` | bool | true |  |  |  | A switch |',
    ]
    assert len(rows) == len(fields_of(Sample))
