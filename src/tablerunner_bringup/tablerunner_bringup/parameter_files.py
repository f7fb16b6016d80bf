"""The commented parameter files under params/, written from the nodes' configuration classes.

    python3 -m tablerunner_bringup.parameter_files src/tablerunner_bringup/params

A test fails when the files and the classes differ.
"""

from __future__ import annotations

import dataclasses
import sys
import textwrap
import typing
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from ceiling_camera.params import CeilingCameraConfig
from fusion_node.params import FusionNodeConfig
from nav_controller.params import NavNodeConfig, SafetyNodeConfig
from odom_node.frames_params import SensorFramesConfig
from odom_node.params import OdomNodeConfig
from sim_bridge.params import BridgeConfig
from tablerunner.config import Config, Parameter, parameters_of
from tablerunner.estimation import LocalizerConfig, SmootherConfig
from tablerunner.odometry import OdometerConfig
from tablerunner.uwb import AnchorHealthConfig, PositionerConfig, RangerConfig
from tablerunner.uwb.device import DeviceConfig
from tablerunner.vision import LocatorConfig
from tablerunner_ros.stamps import StampConfig
from uwb_driver.params import UwbDriverConfig

CONFIGS: dict[str, tuple[type[Config], ...]] = {
    'uwb_driver': (
        UwbDriverConfig,
        StampConfig,
        DeviceConfig,
        RangerConfig,
        PositionerConfig,
        AnchorHealthConfig,
    ),
    'ceiling_camera': (CeilingCameraConfig, StampConfig, LocatorConfig),
    'odom_node': (OdomNodeConfig, StampConfig, OdometerConfig),
    'sensor_frames': (SensorFramesConfig,),
    'fusion_node': (FusionNodeConfig, StampConfig, SmootherConfig, LocalizerConfig),
    'nav_controller': (NavNodeConfig,),
    'safety_stop': (SafetyNodeConfig,),
    'sim_bridge': (BridgeConfig,),
}
"""What each node declares."""

_WIDTH = 96


def render(node: str) -> str:
    """Return the text of a node's parameter file: every parameter with its default."""
    lines = [
        f'# Parameters of {node} and their defaults. What stands here already holds without this',
        '# file; a robot of your own needs only the lines that differ.',
        f'/**/{node}:',
        '  ros__parameters:',
    ]
    if node != 'sim_bridge':
        lines.append('    use_sim_time: false  # true where a simulation or a bag gives the time')
    for cls in CONFIGS[node]:
        lines += _fields(cls, 4)
    return '\n'.join(lines) + '\n'


def _fields(cls: type[Config], indent: int) -> list[str]:
    margin = ' ' * indent
    lines: list[str] = []
    for name, (kind, info) in parameters_of(cls).items():
        lines += _comment(info, margin)
        nested = _config_class(kind)
        if nested is not None:
            lines.append(f'{margin}{name}:')
            lines += _fields(nested, indent + 2)
            continue
        value = _default(cls, name)
        if value is dataclasses.MISSING:
            lines.append(f'{margin}# {name}: must be given')
        elif value in ((), None):
            # ROS has no word for an empty list: it is what holds when nothing is said.
            lines.append(f'{margin}# {name}: []')
        else:
            lines += _assignment(name, value, margin)
    return lines


def _comment(info: Parameter, margin: str) -> list[str]:
    words = info.description
    limits = info.expected('').strip()
    if limits:
        words += f' ({limits})'
    if info.dynamic:
        words += '; can be changed while running'
    return textwrap.wrap(
        words, _WIDTH, initial_indent=f'{margin}# ', subsequent_indent=f'{margin}# '
    )


def _assignment(name: str, value: Any, margin: str) -> list[str]:
    text = yaml.safe_dump(_plain(value), default_flow_style=True, width=_WIDTH - 20)
    first, *others = text.removesuffix('...\n').splitlines()
    return [f'{margin}{name}: {first}', *(f'{margin}  {line.strip()}' for line in others)]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value


def _default(cls: type[Config], name: str) -> Any:
    field = next(item for item in dataclasses.fields(cls) if item.name == name)
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _config_class(kind: Any) -> type[Config] | None:
    for option in (kind, *typing.get_args(kind)):
        if isinstance(option, type) and issubclass(option, Config):
            return option
    return None


def main() -> None:
    """Write every file into the folder given on the command line."""
    folder = Path(sys.argv[1])
    for node in CONFIGS:
        (folder / f'{node}.yaml').write_text(render(node), encoding='utf-8')


if __name__ == '__main__':
    main()
