"""launch/delivery.launch.py against stand-ins for launch and launch_ros, which may be absent."""

from __future__ import annotations

import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import yaml

from tablerunner.errors import ConfigError
from tablerunner.scenario import load_scenario
from tablerunner_bringup import parameters
from tablerunner_bringup.description import ARGUMENTS, describe
from tablerunner_bringup.nodes import nodes_of
from tablerunner_bringup.run_options import RunOptions

FILE = Path(__file__).parents[1] / 'launch' / 'delivery.launch.py'
RESTAURANT = Path(__file__).parents[1] / 'scenarios' / 'restaurant.yaml'
DEFAULTS = {name: default for name, default, _ in ARGUMENTS} | {'scenario': str(RESTAURANT)}


class Made:
    """Remembers what it was made with."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments = arguments
        self.named = named

    def perform(self, context: dict[str, str]) -> str:
        """Return the value of a launch configuration."""
        return context[self.arguments[0]]


@pytest.fixture
def description(monkeypatch: pytest.MonkeyPatch) -> Made:
    """Return what the launch file describes."""
    parts = {
        'launch': ('LaunchDescription',),
        'launch.actions': ('DeclareLaunchArgument', 'OpaqueFunction', 'Shutdown'),
        'launch.substitutions': ('LaunchConfiguration',),
        'launch_ros': (),
        'launch_ros.actions': ('Node',),
    }
    for name, classes in parts.items():
        module = types.ModuleType(name)
        for each in classes:
            setattr(module, each, type(each, (Made,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(FILE))['generate_launch_description']()


def test_launch_file_declares_every_argument(description):
    """`ros2 launch --show-args` shows name, default and description of each."""
    *declared, _ = description.arguments[0]
    assert [item.arguments[0] for item in declared] == [name for name, _, _ in ARGUMENTS]
    assert all(item.named['description'] for item in declared)


def test_launch_file_makes_the_nodes_of_the_list(description):
    """The nodes, their parameters and remappings are those that `tablerunner launch` starts."""
    function = description.arguments[0][-1].named['function']
    made = function({**DEFAULTS, 'namespace': 'robot2', 'params': 'mine.yaml'})
    assert [(item.named['package'], item.named['executable']) for item in made] == [
        (spec.package, spec.executable)
        for spec in nodes_of(RunOptions(), load_scenario(RESTAURANT))
    ]
    for item in made:
        assert item.named['namespace'] == 'robot2'
        assert item.named['parameters'][1] == 'mine.yaml'
        assert 'on_exit' in item.named
    by_name = {item.named['name']: item.named for item in made}
    assert by_name['uwb_driver']['parameters'][0]['anchor_ids'] == ['A0', 'A1', 'A2', 'A3']
    assert by_name['sim_bridge']['remappings'] == [('clock', '/clock')]


def test_describe_parameters_equal_those_of_the_launcher(tmp_path):
    """What a launch file passes on and what the launcher writes to a file is the same."""
    from tablerunner_bringup.description import _options
    from tablerunner_bringup.launching import scenario_of

    run, scenario = scenario_of(_options(DEFAULTS))
    for node, spec in zip(describe(DEFAULTS), nodes_of(run, scenario), strict=True):
        file = tmp_path / f'{spec.name}.yaml'
        parameters.write(file, spec.name, spec.parameters(scenario, run))
        told = yaml.safe_load(file.read_text(encoding='utf-8'))
        assert told[f'/**/{node.name}']['ros__parameters'] == node.parameters


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('seed', 'many'),
        ('seed', '-1'),
        ('simulated', 'maybe'),
        ('real_time_factor', '0'),
        ('scenario', '/nowhere.yaml'),
    ],
)
def test_describe_bad_argument_is_refused(name, value):
    """The message names the argument and the value."""
    with pytest.raises(ConfigError, match=value):
        describe({**DEFAULTS, name: value})
