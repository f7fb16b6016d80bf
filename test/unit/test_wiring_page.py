"""The pages for builders of robots: every parameter of ours that they set exists and fits."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tablerunner.config import Document, build
from tablerunner.errors import ConfigError
from tablerunner_bringup.parameter_files import CONFIGS
from tablerunner_ros.parameters import fields_of

DOCS = Path(__file__).parents[2] / 'docs'
PAGES = [DOCS / 'wiring.md']


def blocks(page: Path) -> list[str]:
    """Return the indented blocks of a page."""
    found: list[list[str]] = [[]]
    for line in page.read_text(encoding='utf-8').splitlines():
        if line.startswith('    '):
            found[-1].append(line[4:])
        else:
            found.append([])
    return ['\n'.join(lines) for lines in found if lines]


def settings(page: Path) -> list[tuple[str, dict[str, object]]]:
    """Return what a page sets: nodes and their parameters by dotted name."""
    found = []
    for text in blocks(page):
        if 'ros__parameters' not in text:
            continue
        for name, item in yaml.safe_load(text).items():
            if name.startswith('/**/'):
                found.append((name.removeprefix('/**/'), item['ros__parameters']))
    return found


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_page_sets_parameters_that_exist(page: Path) -> None:
    """Names are known, and the values are accepted by the configuration of the node."""
    found = settings(page)
    assert len(found) >= 3
    for node, values in found:
        known = {field.name for cls in CONFIGS[node] for field in fields_of(cls)}
        assert set(values) <= known, node
        for cls in CONFIGS[node]:
            own = {name: values[name] for name in values if name in names_of(cls)}
            build(cls, Document(nested(own), page.name))


def names_of(cls: type) -> set[str]:
    """Return the dotted names of a configuration."""
    return {field.name for field in fields_of(cls)}


def nested(values: dict[str, object]) -> dict[str, object]:
    """Return dotted names as mappings in mappings."""
    made: dict[str, object] = {}
    for name, value in values.items():
        *path, last = name.split('.')
        at = made
        for part in path:
            at = at.setdefault(part, {})  # type: ignore[assignment]
        at[last] = value
    return made


def test_settings_finds_a_wrong_value() -> None:
    """The check above can fail."""
    with pytest.raises(ConfigError, match=r'wheels\.track'):
        build(CONFIGS['odom_node'][2], Document(nested({'wheels.track': -1.0}), 'page'))
