"""docs/fuzzy.md against the code it is about."""

from __future__ import annotations

import dataclasses
import shlex
from pathlib import Path

import pytest

from tablerunner.cli import main as cli
from tablerunner.config import Config, Document, parameters_of
from tablerunner.control.contour import ContourConfig
from tablerunner.control.fuzzy import ReactiveConfig, TrackConfig, read_base
from tablerunner.control.fuzzy_controller import DetourConfig

PAGE = Path(__file__).parents[5] / 'docs' / 'fuzzy.md'


def part(name: str) -> list[str]:
    """Return the lines between a mark and the next end."""
    text = PAGE.read_text(encoding='utf-8')
    return text.split(f'<!-- {name} -->\n')[1].split('\n<!-- end -->')[0].splitlines()


@pytest.mark.parametrize(
    ('cls', 'prefix'),
    [
        (ReactiveConfig, 'reactive.'),
        (TrackConfig, 'track.'),
        (ContourConfig, 'contour.'),
        (DetourConfig, 'detour.'),
    ],
)
def test_parameter_table_is_that_of_the_code(cls: type[Config], prefix: str) -> None:
    rows = []
    for field in dataclasses.fields(cls):
        info = parameters_of(cls)[field.name][1]
        shown = field.default if isinstance(field.default, str) else f'{field.default:g}'
        rows.append(f'| `{prefix}{field.name}` | {shown} | {info.unit} | {info.description} |')
    assert part(cls.__name__)[2:] == rows


def test_example_of_the_command_is_what_it_prints(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, 'entry_points', lambda group: [])
    command, *printed = [line.removeprefix('    ') for line in part('example')]
    assert cli.main(shlex.split(command)[2:]) == 0
    assert capsys.readouterr().out.splitlines() == printed


def test_example_of_a_rule_base_can_be_read() -> None:
    """And says what its words say: hard before something near at speed, not at all far away."""
    text = '\n'.join(part('base')).removeprefix('```yaml\n').removesuffix('```')
    base = read_base(Document.parse(text, 'docs/fuzzy.md'), 'brake')
    assert base.infer_one(0.5, 0.6) == 1.0
    assert base.infer_one(0.5, 0.1) == 0.5
    assert base.infer_one(3.0, 0.6) == 0.0
