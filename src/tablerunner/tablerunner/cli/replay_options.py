"""What `replay` and `plot` have in common: settings from options, scenario and bag."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tablerunner.bags.node_parameters import with_node_parameters
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.errors import ConfigError
from tablerunner.estimation import ESTIMATORS
from tablerunner.scenario import Scenario, load_scenario

SCENARIO_FILE = 'scenario.yaml'


def find_scenario(bag: Path, given: Path | None) -> Scenario | None:
    """Return the scenario that was given, else the one that lies in or beside the bag."""
    file = find_scenario_file(bag, given)
    return None if file is None else load_scenario(file)


def find_scenario_file(bag: Path, given: Path | None) -> Path | None:
    """Return the file that `find_scenario` reads."""
    if given is not None:
        return given
    folders = (bag, bag.parent) if bag.is_dir() else (bag.parent,)
    for folder in folders:
        if (folder / SCENARIO_FILE).is_file():
            return folder / SCENARIO_FILE
    return None


def replay_config(
    scenario: Scenario | None,
    estimator: str,
    start: str,
    namespace: str,
    parameter_files: Sequence[Path] = (),
) -> ReplayConfig:
    """Return the settings of a replay.

    Parameters
    ----------
    scenario : Scenario or None
        Robot and anchors; None for the defaults and the bag's own anchors.
    estimator : str
        Name of the estimator.
    start : str
        ``X,Y,YAW`` in m and rad, or empty to find the start from the measurements.
    namespace : str
        Namespace of the robot in the bag.
    parameter_files : sequence of Path
        ROS parameter files of the robot's nodes, over the scenario.
    """
    config = ReplayConfig() if scenario is None else ReplayConfig.from_scenario(scenario)
    config = with_node_parameters(config, parameter_files)
    try:
        pose = parse_start(start) or config.localizer.initial_pose
        localizer = replace(config.localizer, estimator=estimator, initial_pose=pose)
    except ConfigError as error:
        raise error.located('options') from None
    return replace(config, localizer=localizer, namespace=namespace)


def parse_start(text: str) -> tuple[float, ...]:
    """Return the three numbers of ``X,Y,YAW``; nothing for an empty text."""
    if not text.strip():
        return ()
    try:
        numbers = tuple(float(part) for part in text.split(','))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise ConfigError('--start', text, 'X,Y,YAW: three numbers in m, m and rad')
    return numbers


def estimator_names(text: str) -> tuple[str, ...]:
    """Return the estimators that an option names: one, several with commas, or ``all``."""
    if text.strip() == 'all':
        return tuple(ESTIMATORS)
    names = tuple(dict.fromkeys(part.strip() for part in text.split(',')))
    for name in names:
        if name not in ESTIMATORS:
            expected = 'one of ' + ', '.join([*ESTIMATORS, 'all'])
            raise ConfigError('estimator', name, expected, 'options')
    return names
