"""ROS parameter files of the nodes as settings of a replay: a robot's own robot.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.config import Document, build, to_mapping
from tablerunner.errors import ConfigError

_PARTS = {
    'uwb_driver': ('ranger', 'positioner'),
    'odom_node': ('odometer',),
    'fusion_node': ('localizer',),
}
_OWN = {
    'odom_node': ('left_joints', 'right_joints', 'imu_heading', 'imu_tilt', 'odom_frame'),
    'fusion_node': ('map_frame', 'base_frame'),
}
"""Parameters of the nodes themselves that `ReplayConfig` has under the same name."""


def with_node_parameters(config: ReplayConfig, files: Sequence[Path]) -> ReplayConfig:
    """Return settings changed by ROS parameter files, later ones over earlier ones.

    What is for other nodes, or of no concern to a replay, is passed over; a value that a node
    would refuse is refused here, too.

    Raises
    ------
    ConfigError
        A file cannot be read, is no parameter file, or holds such a value.
    """
    for path in files:
        data = Document.load(path).data
        whole = to_mapping(config)
        for node, parts in _PARTS.items():
            told = node_parameters(data, node, str(path))
            for part in parts:
                _lay(whole[part], told)
            whole.update({name: told[name] for name in _OWN.get(node, ()) if name in told})
        config = build(ReplayConfig, Document(whole, str(path)))
    return config


def node_parameters(data: Any, node: str, source: str) -> dict[str, Any]:
    """Return the parameters of a node in a ROS parameter file, by dotted name.

    Parameters
    ----------
    data : object
        What the file holds: ``NODE: ros__parameters: ...``, with or without namespace, ``/**`` for
        any.
    node : str
        Its name.
    source : str
        The file, for messages.
    """
    if not isinstance(data, dict):
        raise ConfigError('', data, 'nodes with ros__parameters', source)
    found: dict[str, Any] = {}
    for name, item in data.items():
        last = str(name).rpartition('/')[2]
        if last not in (node, '**', '*'):
            continue
        if not isinstance(item, dict) or not isinstance(item.get('ros__parameters'), dict):
            raise ConfigError(str(name), item, 'ros__parameters with a mapping below', source)
        found.update(_flat(item['ros__parameters'], ''))
    return found


def _flat(values: dict[str, Any], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found.update(_flat(value, f'{prefix}{name}.'))
        else:
            found[f'{prefix}{name}'] = value
    return found


def _lay(mapping: dict[str, Any], told: dict[str, Any]) -> None:
    """Write those parameters that a mapping of a configuration has into it."""
    for name, value in told.items():
        *path, last = name.split('.')
        at: Any = mapping
        for part in path:
            at = at.get(part) if isinstance(at, dict) else None
        if isinstance(at, dict) and last in at and not isinstance(at[last], dict):
            at[last] = value
