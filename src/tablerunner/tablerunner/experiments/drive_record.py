"""Rooms on disk: the scenario as YAML, and beside it what else a drive needs and what came of it.

The YAML is a scenario like any other: `tablerunner demo` and the simulator take it, too. Of the
drive itself nothing has to be kept: the room and its seed make it again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from tablerunner.config.build import to_mapping
from tablerunner.errors import ConfigError
from tablerunner.experiments.drive_room import RoomDrive
from tablerunner.experiments.random_room import DriveRoom
from tablerunner.scenario import load_scenario

_FIELDS = {
    'seed': int,
    'kind': str,
    'unknown': list,
    'tour': list,
    'closed': list,
    'unknown_start': bool,
}


def save_room(folder: Path, room: DriveRoom, drives: Sequence[RoomDrive] = ()) -> Path:
    """Write ``room-SEED.yaml`` and ``room-SEED.json``; return the first.

    Raises
    ------
    ConfigError
        A file cannot be written.
    """
    file = folder / f'room-{room.seed}.yaml'
    scenario = yaml.safe_dump(to_mapping(room.scenario), sort_keys=False, default_flow_style=None)
    content = {name: _plain(getattr(room, name)) for name in _FIELDS}
    content['drives'] = [drive.as_json() for drive in drives]
    beside = json.dumps(content, indent=2, allow_nan=False) + '\n'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file.write_text(scenario, encoding='utf-8')
        file.with_suffix('.json').write_text(beside, encoding='utf-8')
    except OSError as error:
        expected = f'a file that can be written ({error.strerror})'
        raise ConfigError('', str(file), expected) from error
    return file


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def load_room(file: Path) -> DriveRoom:
    """Read a room that was saved.

    Raises
    ------
    ConfigError
        A file is missing or is not what `save_room` writes.
    """
    scenario = load_scenario(file)
    beside = file.with_suffix('.json')
    try:
        content = json.loads(beside.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise ConfigError('', str(beside), f'the JSON file of a saved room ({error})') from error
    if not isinstance(content, dict):
        raise ConfigError('', str(beside), 'the JSON file of a saved room')
    for name, kind in _FIELDS.items():
        value = content.get(name)
        if not isinstance(value, kind):
            words = {int: 'a number', str: 'a word', list: 'a list', bool: 'true or false'}[kind]
            raise ConfigError(name, value, words, str(beside))
    for name in content['tour']:
        if name not in scenario.stops:
            raise ConfigError('tour', name, 'tables of the scenario', str(beside))
    boxes = [box.name for box in scenario.boxes]
    for name in content['unknown']:
        if name not in boxes:
            raise ConfigError('unknown', name, 'boxes of the scenario', str(beside))
    return DriveRoom(
        content['seed'],
        content['kind'],
        scenario,
        tuple(content['unknown']),
        tuple(content['tour']),
        tuple(content['closed']),
        content['unknown_start'],
    )
