"""Parameters of sim_bridge."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_bridge.params import BridgeConfig
from tablerunner.config import parameters_of
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2

PAGE = Path(__file__).parents[2] / 'docs' / 'simulation.md'


def test_params_start_is_a_pose_or_left_to_the_scenario() -> None:
    assert BridgeConfig(scenario='x').start_pose is None
    assert BridgeConfig(scenario='x', start=(1.0, 2.0, 3.0)).start_pose == Pose2(1.0, 2.0, 3.0)
    with pytest.raises(ConfigError, match='start: got'):
        BridgeConfig(scenario='x', start=(1.0,))
    with pytest.raises(ConfigError, match=r'start: got.*expected no value'):
        BridgeConfig(scenario='x', start=(1.0, 2.0, 3.0), robots=2)


def test_params_are_all_in_the_documentation_with_their_defaults() -> None:
    """The table of docs/simulation.md has a row for each, and says the same default."""
    rows = [line.split('|')[1:3] for line in PAGE.read_text().splitlines() if '|' in line]
    told: dict[str, str] = {}
    for names, defaults in rows:
        parts = [name.strip(' `') for name in names.split(',')]
        values = [value.strip() for value in defaults.split(',')]
        told.update(zip(parts, values if len(values) == len(parts) else [''], strict=False))
    for name in parameters_of(BridgeConfig):
        default = getattr(BridgeConfig(scenario=''), name)
        assert told[name] == ('[]' if default == () else str(default)), name
