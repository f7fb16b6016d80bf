"""The files under params/ say what the classes say."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory

from tablerunner_bringup.nodes import NODES
from tablerunner_bringup.parameter_files import CONFIGS, render
from tablerunner_ros.parameters import fields_of

FOLDER = Path(__file__).parents[1] / 'params'


def flat(values: dict, prefix: str = '') -> dict:
    """Return values by dotted names."""
    found = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found.update(flat(value, f'{prefix}{name}.'))
        else:
            found[prefix + name] = value
    return found


@pytest.mark.parametrize('node', CONFIGS)
def test_parameter_file_equals_defaults_of_classes(node):
    """A changed default, unit or description shows here; the module's docstring says the cure."""
    assert (FOLDER / f'{node}.yaml').read_text(encoding='utf-8') == render(node)


@pytest.mark.parametrize('node', CONFIGS)
def test_parameter_file_names_only_known_parameters(node):
    """What the file sets, the node declares, and floats are written as floats."""
    data = yaml.safe_load((FOLDER / f'{node}.yaml').read_text(encoding='utf-8'))
    told = flat(data[f'/**/{node}']['ros__parameters'])
    told.pop('use_sim_time', None)
    known = {field.name: field.type_ for cls in CONFIGS[node] for field in fields_of(cls)}
    assert set(told) <= set(known)
    for name, value in told.items():
        kinds = {type(item) for item in (value if isinstance(value, list) else [value])}
        assert len(kinds) == 1, name
        wanted = {'DOUBLE': float, 'INTEGER': int, 'BOOL': bool, 'STRING': str}
        assert kinds.pop() is wanted[known[name].name.removesuffix('_ARRAY')], name


def test_parameter_files_every_node_has_one():
    """No node of the list is without a file, and all are installed."""
    installed = Path(get_package_share_directory('tablerunner_bringup')) / 'params'
    assert set(CONFIGS) == {spec.name for spec in NODES}
    assert {file.stem for file in installed.glob('*.yaml')} == set(CONFIGS)
