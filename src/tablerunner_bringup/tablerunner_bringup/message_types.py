"""Python classes of message types that are known only by name."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

from tablerunner.errors import TablerunnerError


class MessageTypeError(TablerunnerError):
    """A message type cannot be used here: not a plain message, or its package is not built."""


@cache
def message_class(name: str) -> Any:
    """Return the class of a message type such as ``sensor_msgs/msg/Imu``.

    Raises
    ------
    MessageTypeError
        The name is not that of a plain message, or its Python package is not in the environment.
    """
    package, _, rest = name.partition('/')
    folder, _, short = rest.partition('/')
    if folder != 'msg' or not short:
        raise MessageTypeError(f'{name} is not a plain message')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), short)
    except (ImportError, AttributeError) as error:
        raise MessageTypeError(f'no Python support for {name}: {error}') from error
