"""The core must be usable where there is no ROS: nothing of ROS is imported anywhere in it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / 'src' / 'tablerunner' / 'tablerunner'
ROS = re.compile(
    r'rclpy|rcl_interfaces|rosgraph|ament_\w+|rosidl\w*|launch|launch_ros|tf2_\w+|'
    r'builtin_interfaces|unique_identifier_msgs|\w+_msgs|'
    r'tablerunner_\w+|uwb_driver|odom_node|fusion_node|nav_controller|sim_bridge|ceiling_camera'
)


def imported(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the top-level name of every absolute import, wherever it stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.split('.')[0]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module.split('.')[0]
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, (ast.Name, ast.Attribute))
            and (node.func.id if isinstance(node.func, ast.Name) else node.func.attr)
            in ('import_module', '__import__')
            and node.args
            and isinstance(node.args[0], ast.Constant)
            and isinstance(node.args[0].value, str)
        ):
            yield node.lineno, node.args[0].value.split('.')[0]


def test_core_imports_nothing_of_ros() -> None:
    files = sorted(CORE.rglob('*.py'))
    assert files, f'no Python file below {CORE}'
    found = [
        f'{path.relative_to(CORE)}:{line} imports {name}'
        for path in files
        for line, name in imported(path.read_text(encoding='utf-8'))
        if ROS.fullmatch(name)
    ]
    assert not found, '\n'.join(found)


@pytest.mark.parametrize(
    'line',
    [
        'import rclpy',
        'from rclpy.node import Node',
        'import geometry_msgs.msg as g',
        'def f():\n    from tablerunner_ros import qos',
        "importlib.import_module('rosgraph_msgs.msg')",
        'if TYPE_CHECKING:\n    from builtin_interfaces.msg import Time',
        'from rosgraph_msgs.msg import Clock',
        'import tablerunner_interfaces',
    ],
)
def test_ros_import_is_found(line: str) -> None:
    assert any(ROS.fullmatch(name) for _, name in imported(line))


@pytest.mark.parametrize(
    'line', ['import numpy', 'from rosbags.rosbag2 import Reader', 'import os']
)
def test_other_import_is_allowed(line: str) -> None:
    assert not any(ROS.fullmatch(name) for _, name in imported(line))
