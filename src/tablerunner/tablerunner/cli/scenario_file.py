"""Scenarios by path or by the name of one that is installed."""

from __future__ import annotations

import os
from pathlib import Path

from tablerunner.errors import ConfigError
from tablerunner.scenario import Scenario

_SHARED = Path('share') / 'tablerunner_bringup' / 'scenarios'


def find_scenario_file(name: str) -> Path:
    """Return the file of a scenario: a path, or the name of one of tablerunner_bringup's.

    Raises
    ------
    ConfigError
        There is no such file; the message lists the installed names.
    """
    path = Path(name)
    if path.is_file():
        return path
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    folders = [Path(prefix) / _SHARED for prefix in prefixes if prefix]
    for folder in folders:
        if (folder / f'{name}.yaml').is_file():
            return folder / f'{name}.yaml'
    known = sorted({file.stem for folder in folders for file in folder.glob('*.yaml')})
    names = f', or one of {", ".join(known)}' if known else ' (no scenarios are installed here)'
    raise ConfigError('--scenario', name, f'a scenario file{names}')


def find_route(scenario: Scenario, name: str) -> tuple[tuple[float, float], ...]:
    """Return a route by its name; the first one when the name is empty.

    Raises
    ------
    ConfigError
        There is no such route, or none at all.
    """
    if not scenario.routes:
        raise ConfigError('--scenario', scenario.name, 'a scenario with at least one route')
    chosen = name or next(iter(scenario.routes))
    if chosen not in scenario.routes:
        raise ConfigError('--route', name, 'one of ' + ', '.join(scenario.routes))
    return scenario.routes[chosen]
