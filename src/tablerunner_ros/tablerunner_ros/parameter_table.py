"""The parameters of a node as a table for its documentation, from the same Configs it declares.

    python3 -m tablerunner_ros.parameter_table docs/nodes.md

writes a table below each line ``<!-- parameters: MODULE:CLASS[, MODULE:CLASS ...] -->`` up to the
next ``<!-- end -->``. A test compares the page with the classes.
"""

from __future__ import annotations

import dataclasses
import importlib
import re
import sys
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import Any

from tablerunner.config import Config, Parameter, parameters_of
from tablerunner_ros.parameters import Type, fields_of

_BLOCK = re.compile(r'(<!-- parameters: ([^>]*?) -->\n).*?(<!-- end -->)', re.DOTALL)
_TYPES = {
    Type.DOUBLE: 'double',
    Type.INTEGER: 'integer',
    Type.BOOL: 'bool',
    Type.STRING: 'string',
    Type.DOUBLE_ARRAY: 'double[]',
    Type.INTEGER_ARRAY: 'integer[]',
    Type.BOOL_ARRAY: 'bool[]',
    Type.STRING_ARRAY: 'string[]',
}


def table(classes: Iterable[type[Config]]) -> str:
    """Return a Markdown table of all parameters of some Configs, in order."""
    lines = [
        '| parameter | type | default | unit | accepted | live | |',
        '|---|---|---|---|---|---|---|',
    ]
    for cls in classes:
        defaults = _defaults(cls)
        for field in fields_of(cls):
            info = field.info
            cells = (
                f'`{field.name}`',
                _TYPES[field.type_],
                _shown(defaults.get(field.name, _REQUIRED)),
                info.unit,
                _accepted(info),
                'yes' if info.dynamic else '',
                info.description,
            )
            lines.append('| ' + ' | '.join(cell.replace('|', '\\|') for cell in cells) + ' |')
    return '\n'.join(lines) + '\n'


def fill(page: str) -> str:
    """Return a page with its tables made anew."""
    return _BLOCK.sub(lambda block: block[1] + table(_classes(block[2])) + block[3], page)


def _classes(names: str) -> list[type[Config]]:
    found = []
    for name in names.split(','):
        module, _, cls = name.strip().partition(':')
        found.append(getattr(importlib.import_module(module), cls))
    return found


_REQUIRED = object()


def _defaults(cls: type[Config], path: str = '') -> dict[str, Any]:
    """Return the default of each parameter by dotted name; those that must be given are absent."""
    values: dict[str, Any] = {}
    for item in dataclasses.fields(cls):
        kind, _ = parameters_of(cls)[item.name]
        full = f'{path}.{item.name}' if path else item.name
        default = _REQUIRED
        if item.default_factory is not dataclasses.MISSING:
            default = item.default_factory()
        elif item.default is not dataclasses.MISSING:
            default = item.default
        if isinstance(kind, type) and issubclass(kind, Config):
            if isinstance(default, Config):
                values.update(_flat(default, full))
        elif default is not _REQUIRED:
            values[full] = default
    return values


def _flat(config: Config, path: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name in parameters_of(type(config)):
        value = getattr(config, name)
        if isinstance(value, Config):
            values.update(_flat(value, f'{path}.{name}'))
        else:
            values[f'{path}.{name}'] = value
    return values


def _shown(value: Any) -> str:
    if value is _REQUIRED:
        return '**required**'
    if value is None:
        return ''
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return '[' + ', '.join(_shown(item) for item in value) + ']'
    if isinstance(value, float):
        return f'{value:g}'
    return str(value)


def _accepted(info: Parameter) -> str:
    bounds = Parameter('', low=info.low, high=info.high, above=info.above, choices=info.choices)
    return bounds.expected('').strip()


def main(arguments: list[str]) -> int:
    """Rewrite the tables of the pages that are named."""
    for argument in arguments:
        path = Path(argument)
        path.write_text(fill(path.read_text(encoding='utf-8')), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
