"""Commands are written for the oldest typer that they may meet: 0.9, of Ubuntu 24.04."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = [
    *ROOT.glob('src/tablerunner/tablerunner/cli/*.py'),
    ROOT / 'src/tablerunner_bringup/tablerunner_bringup/commands.py',
]


def test_no_argument_of_a_command_is_annotated_with_a_bar():
    """It fails at start with `Type not yet supported: pathlib.Path | None`; Optional works."""
    found = [
        f'{path.name}:{node.lineno}: {ast.unparse(node)}'
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.Subscript)
        and ast.unparse(node.value).endswith('Annotated')
        and isinstance(node.slice, ast.Tuple)
        and isinstance(node.slice.elts[0], ast.BinOp)
    ]
    assert found == []


def test_no_module_with_commands_postpones_its_annotations():
    """Typer 0.9 then sees strings, and drops every option name and help that they hold."""
    found = [
        path.name
        for path in FILES
        if 'Annotated[' in (text := path.read_text(encoding='utf-8'))
        and 'from __future__ import annotations' in text
    ]
    assert found == []
