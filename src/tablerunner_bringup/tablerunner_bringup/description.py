"""The run as a launch file sees it: text arguments in, nodes with parameters out.

It imports nothing of `launch`, so that it can be tested where that is not installed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tablerunner.config import Document, build
from tablerunner.errors import ConfigError
from tablerunner_bringup.launching import scenario_of
from tablerunner_bringup.nodes import nodes_of
from tablerunner_bringup.parameters import flat
from tablerunner_bringup.run_options import RunOptions

_DEFAULTS = RunOptions()

ARGUMENTS: tuple[tuple[str, str, str], ...] = (
    ('scenario', '', 'Scenario file; the restaurant when empty'),
    ('seed', str(_DEFAULTS.seed), 'Seed of everything that is drawn'),
    ('namespace', '', 'Namespace of all nodes'),
    ('simulated', 'true', 'Whether sim_bridge takes the place of hardware'),
    ('unknown_start', 'false', 'Whether the robot is not told where it stands'),
    ('real_time_factor', str(_DEFAULTS.real_time_factor), 'Simulated seconds per second'),
    ('estimator', _DEFAULTS.estimator, 'Estimator of fusion_node'),
    ('localization_only', 'false', 'Whether somebody else drives, as Nav2: map to odom and pose'),
    ('odom_topic', '', 'Odometry of somebody else; empty: that of odom_node'),
    ('robot_description', 'false', 'Whether robot_state_publisher tells where the sensors sit'),
    ('params', '', 'ROS parameter file over all others'),
)
"""Launch arguments: name, default, description."""


@dataclass(frozen=True)
class DescribedNode:
    """A node ready for `launch_ros.actions.Node`."""

    package: str
    executable: str
    name: str
    namespace: str
    parameters: dict[str, Any]
    parameter_files: tuple[str, ...]
    remap: tuple[tuple[str, str], ...]


def describe(values: Mapping[str, str]) -> tuple[DescribedNode, ...]:
    """Return the nodes for the values of `ARGUMENTS`.

    Raises
    ------
    ConfigError
        An argument or the scenario cannot be used.
    """
    run, scenario = scenario_of(_options(values))
    files = (values['params'],) if values['params'] else ()
    return tuple(
        DescribedNode(
            spec.package,
            spec.executable,
            spec.name,
            run.namespace,
            flat(spec.parameters(scenario, run)),
            files,
            spec.remap,
        )
        for spec in nodes_of(run, scenario)
    )


def _options(values: Mapping[str, str]) -> RunOptions:
    data = {
        'scenario': values['scenario'],
        'seed': _number('seed', values, int),
        'namespace': values['namespace'].strip('/'),
        'simulated': _truth('simulated', values),
        'unknown_start': _truth('unknown_start', values),
        'real_time_factor': _number('real_time_factor', values, float),
        'estimator': values['estimator'],
        'localization_only': _truth('localization_only', values),
        'odom_topic': values['odom_topic'],
        'robot_description': _truth('robot_description', values),
    }
    return build(RunOptions, Document(data, 'launch arguments'))


def _number(name: str, values: Mapping[str, str], kind: type[int] | type[float]) -> float:
    try:
        return kind(values[name])
    except ValueError:
        raise ConfigError(name, values[name], 'a number', 'launch arguments') from None


def _truth(name: str, values: Mapping[str, str]) -> bool:
    word = values[name].lower()
    if word not in {'true', 'false'}:
        raise ConfigError(name, values[name], 'true or false', 'launch arguments')
    return word == 'true'
