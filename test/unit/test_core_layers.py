"""Each part of the core imports only from the parts before it."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / 'src' / 'tablerunner' / 'tablerunner'
PARTS = [
    'errors',
    'geometry',
    'types',
    'stream',
    'config',
    'messages',
    'scenario',
    'uwb',
    'odometry',
    'vision',
    'survey',
    'estimation',
    'control',
    'simulation',
    'evaluation',
    'bags',
    'experiments',
    'doctor',
    'cli',
]
# Beyond the order: the controller works with any estimate, and the simulator must not share a
# measurement model (and its bugs) with what it tests.
FORBIDDEN = {'control': {'estimation'}, 'simulation': {'vision', 'estimation', 'control'}}


def parts_imported(source: str, package: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Yield the line and the part of every import from the core.

    `package` is the dotted package that the source is in, for relative imports.
    """
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            module = '.'.join([*base, *([node.module] if node.module else [])])
            # `from tablerunner import uwb` names the part only here.
            names = [f'{module}.{alias.name}' for alias in node.names]
        for name in names:
            words = name.split('.')
            if words[0] == 'tablerunner' and len(words) > 1 and words[1] in PARTS:
                yield node.lineno, words[1]


def complaints(source: str, part: str, package: tuple[str, ...]) -> list[str]:
    allowed = set(PARTS[: PARTS.index(part) + 1]) - FORBIDDEN.get(part, set())
    return [
        f'line {line}: {part} imports {other}'
        for line, other in parts_imported(source, package)
        if other not in allowed
    ]


def test_every_part_is_known() -> None:
    """A new part has to be given its place in the order."""
    found = {path.stem for path in CORE.glob('*.py')} | {
        path.parent.name for path in CORE.glob('*/__init__.py')
    }
    assert found - {'__init__', '__main__'} <= set(PARTS)


def test_parts_import_only_from_parts_before_them() -> None:
    found = []
    for path in sorted(CORE.rglob('*.py')):
        words = path.relative_to(CORE).with_suffix('').parts
        if words[0] not in PARTS:
            continue
        text = path.read_text(encoding='utf-8')
        for complaint in complaints(text, words[0], ('tablerunner', *words[:-1])):
            found.append(f'{path.relative_to(CORE)}, {complaint}')
    assert not found, '\n'.join(found)


@pytest.mark.parametrize(
    ('part', 'line'),
    [
        ('uwb', 'from tablerunner.estimation import ekf'),
        ('uwb', 'import tablerunner.simulation.room'),
        ('uwb', 'from tablerunner import control'),
        ('uwb', 'from ..control import follower'),
        ('control', 'from tablerunner.estimation.ekf import Ekf'),
        ('simulation', 'from tablerunner.estimation import models'),
        ('simulation', 'from tablerunner.control import fuzzy'),
        ('simulation', 'from tablerunner.vision import distort'),
        ('bags', 'def f():\n    from tablerunner.cli import main'),
    ],
)
def test_import_against_the_order_is_found(part: str, line: str) -> None:
    assert complaints(line, part, ('tablerunner', part))


@pytest.mark.parametrize(
    ('part', 'line'),
    [
        ('cli', 'from tablerunner.estimation import ekf'),
        ('uwb', 'from tablerunner.errors import TablerunnerError'),
        ('uwb', 'from . import ranging'),
        ('uwb', 'from ..types import RangeSample'),
        ('uwb', 'import numpy'),
    ],
)
def test_import_along_the_order_is_allowed(part: str, line: str) -> None:
    assert not complaints(line, part, ('tablerunner', part))
