"""Message definitions without ROS: standard ones, Tablerunner's own, and any package's.

The standard types of ROS 2 Jazzy come with `rosbags`. Tablerunner's own are data files of this
package (``interfaces/*.msg``), byte for byte those of the package ``tablerunner_interfaces``, so
that a bag can be written where nothing of ROS is installed. Types of other packages are read from
the ``share`` folders of the workspace that is sourced.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias

from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from tablerunner.errors import BagError

TypeStore: TypeAlias = Any
"""A `rosbags` type store; the package carries no type annotations that mypy would read."""

OWN_PACKAGE = 'tablerunner_interfaces'
"""Package of Tablerunner's own messages."""

_NAME = re.compile(r'(?P<package>[A-Za-z]\w*)/msg/(?P<name>[A-Za-z]\w*)')


def own_definitions() -> dict[str, str]:
    """Return the text of each message of ``tablerunner_interfaces``, by full type name."""
    folder = resources.files(__package__) / 'interfaces'
    return {
        f'{OWN_PACKAGE}/msg/{file.name[:-4]}': file.read_text(encoding='utf-8')
        for file in sorted(folder.iterdir(), key=lambda item: item.name)
        if file.name.endswith('.msg')
    }


@lru_cache(maxsize=1)
def known_types() -> TypeStore:
    """Return the type store of ROS 2 Jazzy together with Tablerunner's own messages.

    It is shared: do not register into it, use `types_for`.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for name, text in own_definitions().items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


def types_for(names: Iterable[str], prefixes: Iterable[Path] | None = None) -> TypeStore:
    """Return a type store that knows these types, for a recorder of any topic.

    Parameters
    ----------
    names : iterable of str
        Full type names, e.g. ``sensor_msgs/msg/Imu``.
    prefixes : iterable of Path, optional
        Install prefixes whose ``share/PACKAGE/msg`` is looked through; those of
        ``AMENT_PREFIX_PATH`` when not given. What is found there goes before what is built in,
        for it is what runs.

    Raises
    ------
    BagError
        A definition is found nowhere or cannot be read; names every such type.
    """
    folders = list(_environment_prefixes() if prefixes is None else prefixes)
    known = known_types()
    types: dict[str, Any] = {}
    missing: list[str] = []
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name in types or name in missing:
            continue
        text = installed_definition(name, folders)
        if text is None:
            if name in known.fielddefs:
                types[name] = known.fielddefs[name]
                waiting.extend(_named_types(known.fielddefs[name][1]))
            else:
                missing.append(name)
            continue
        try:
            types.update(get_types_from_msg(text, name))
        except TypesysError as error:
            raise BagError(f'the definition of {name} cannot be read: {error}') from error
        waiting.extend(_named_types(types[name][1]))
    if missing:
        places = ', '.join(str(folder) for folder in folders) or 'no prefix is set'
        raise BagError(
            f'no definition of {", ".join(sorted(missing))}: neither standard, nor own, nor in '
            f'the share folders of AMENT_PREFIX_PATH ({places})'
        )
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def installed_definition(name: str, prefixes: Iterable[Path]) -> str | None:
    """Return the .msg text of a type from the first install prefix that has it, or None."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    for prefix in prefixes:
        file = prefix / 'share' / match['package'] / 'msg' / f'{match["name"]}.msg'
        try:
            return file.read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError):
            continue
    return None


def parse_definition(name: str, encoding: str, text: str) -> dict[str, Any]:
    """Return the types that a definition stored in a bag describes.

    Parameters
    ----------
    name : str
        Full type name.
    encoding : str
        ``ros2msg`` or ``ros2idl``, as the storage says.
    text : str
        The definition with those of the types it uses.

    Raises
    ------
    BagError
        The text is not a definition of this encoding, or not of this type.
    """
    separator = '=' * 80 + '\n'
    types: dict[str, Any] = {}
    try:
        if encoding == 'ros2msg':
            types.update(get_types_from_msg(text, name))
        elif text.startswith(f'{separator}IDL: '):
            for part in text.split(separator)[1:]:
                types.update(get_types_from_idl(part.split('\n', 1)[1]))
        else:
            types.update(get_types_from_idl(text))
    except (TypesysError, ValueError, IndexError, KeyError) as error:
        raise BagError(f'the definition of {name} cannot be read: {error}') from error
    if name not in types:
        raise BagError(f'the definition stored for {name} is of another type')
    return types


def _environment_prefixes() -> list[Path]:
    text = os.environ.get('AMENT_PREFIX_PATH', '')
    return [Path(part) for part in text.split(os.pathsep) if part]


def _named_types(fields: Any) -> list[str]:
    """Return the message types that fields refer to, through arrays and sequences."""
    names = []
    for _, description in fields:
        inner = description
        while isinstance(inner[1], tuple) and isinstance(inner[1][0], tuple):
            inner = inner[1][0]
        if isinstance(inner[1], str):
            names.append(inner[1])
    return names
