"""YAML files that remember on which line each value stands."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class Document:
    """Plain data together with where it came from.

    Attributes
    ----------
    data : Any
        Nested dicts, lists and scalars.
    source : str
        File name, or whatever names the origin for people.
    lines : dict of str to int
        Line, from 1, of each dotted path such as ``anchors[2].position``.
    """

    data: Any
    source: str = ''
    lines: dict[str, int] = field(default_factory=dict)

    @classmethod
    def load(cls, path: Path) -> Document:
        """Read a YAML file.

        Raises
        ------
        ConfigError
            The file cannot be read, is not YAML, or names one key twice.
        """
        try:
            text = path.read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError('', str(path), f'a readable file ({error})', str(path)) from error
        return cls.parse(text, str(path))

    @classmethod
    def parse(cls, text: str, source: str = '') -> Document:
        """Read YAML text; errors as in `load`."""
        try:
            node = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            line = None if mark is None else mark.line + 1
            problem = getattr(error, 'problem', None) or str(error)
            raise ConfigError('', problem, 'YAML', source, line) from error
        lines: dict[str, int] = {}
        data = None if node is None else _read(node, '', lines, source)
        return cls(data, source, lines)

    def line(self, path: str) -> int | None:
        """Return the line of a dotted path, or of the nearest thing around it that has one."""
        while path:
            if path in self.lines:
                return self.lines[path]
            cut = max(path.rfind('.'), path.rfind('['))
            path = path[: max(cut, 0)]
        return self.lines.get('')


def _read(node: yaml.Node, path: str, lines: dict[str, int], source: str) -> Any:
    lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        mapping: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            here = f'{path}.{key}' if path else key
            if key in mapping:
                line = key_node.start_mark.line + 1
                raise ConfigError(here, key, 'each key once', source, line)
            lines[here] = key_node.start_mark.line + 1
            mapping[key] = _read(value_node, here, lines, source)
        return mapping
    if isinstance(node, yaml.SequenceNode):
        return [
            _read(item, f'{path}[{index}]', lines, source) for index, item in enumerate(node.value)
        ]
    return yaml.SafeLoader('').construct_object(node, deep=True)
