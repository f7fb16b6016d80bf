"""Make configuration records from plain mappings, strictly."""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from tablerunner.config.document import Document
from tablerunner.config.parameter import Config, parameters_of
from tablerunner.errors import ConfigError

C = TypeVar('C', bound=Config)


def load(cls: type[C], path: Path) -> C:
    """Read a YAML file into a `Config`; a `ConfigError` names file, line, field and value."""
    return build(cls, Document.load(path))


def build(cls: type[C], document: Document, path: str = '') -> C:
    """Make a `Config` from (a part of) a document.

    Parameters
    ----------
    cls : type
        The Config class.
    document : Document
        ``Document(mapping)`` does for data that came from no file.
    path : str
        Dotted path of `cls` inside the document, for messages; the data is `document.data`.

    Raises
    ------
    ConfigError
        Unknown or missing field, wrong type, value out of bounds; with its place.
    """
    return typing.cast('C', _record(cls, document.data, path, document))


def to_mapping(config: Config) -> dict[str, Any]:
    """Return plain nested dicts and lists (for YAML or JSON) of a Config."""
    return {name: _plain(getattr(config, name)) for name in parameters_of(type(config))}


def _plain(value: Any) -> Any:
    if isinstance(value, Config):
        return to_mapping(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value.value if isinstance(value, Enum) else value


def _record(cls: type[Config], data: Any, path: str, document: Document) -> Config:
    if data is None:
        data = {}
    if not isinstance(data, dict):
        raise _error(document, path, data, 'a mapping of fields')
    known = parameters_of(cls)
    for key in data:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f'did you mean {near[0]}?' if near else 'known are ' + ', '.join(known)
            raise _error(document, _join(path, key), key, f'a known field ({hint})')
    values = {}
    for item in dataclasses.fields(cls):
        kind, info = known[item.name]
        if item.name in data:
            values[item.name] = _value(kind, data[item.name], _join(path, item.name), document)
        elif item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
            words = f'{info.expected("a value")}: {info.description}'
            raise _error(document, _join(path, item.name), 'nothing', words)
    try:
        return cls(**values)
    except ConfigError as error:
        field = _join(path, error.field)
        raise error.located(document.source, document.line(field), path) from None


def _value(kind: Any, data: Any, path: str, document: Document) -> Any:
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        if data is None:
            return None
        kind = next(arg for arg in typing.get_args(kind) if arg is not type(None))
        origin = typing.get_origin(kind)
    if origin is tuple:
        if not isinstance(data, (list, tuple)):
            raise _error(document, path, data, 'a list')
        arguments = typing.get_args(kind)
        if arguments[-1] is not Ellipsis and len(arguments) != len(data):
            raise _error(document, path, data, f'{len(arguments)} values')
        kinds = [arguments[0]] * len(data) if arguments[-1] is Ellipsis else arguments
        return tuple(
            _value(item_kind, item, f'{path}[{index}]', document)
            for index, (item, item_kind) in enumerate(zip(data, kinds, strict=True))
        )
    if origin is dict:
        if not isinstance(data, dict):
            raise _error(document, path, data, 'a mapping')
        item_kind = typing.get_args(kind)[1]
        return {
            str(key): _value(item_kind, item, _join(path, key), document)
            for key, item in data.items()
        }
    if isinstance(kind, type) and issubclass(kind, Config):
        return _record(kind, data, path, document)
    if isinstance(kind, type) and issubclass(kind, Enum):
        try:
            return kind(data)
        except ValueError:
            words = 'one of ' + ', '.join(str(item.value) for item in kind)
            raise _error(document, path, data, words) from None
    if kind is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    return data


def _join(path: str, name: Any) -> str:
    return f'{path}.{name}' if path else str(name)


def _error(document: Document, path: str, value: Any, expected: str) -> ConfigError:
    return ConfigError(path, value, expected, document.source, document.line(path))
