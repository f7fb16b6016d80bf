"""The tables of the documentation against the records they are about."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from tablerunner.config import Config, parameters_of
from tablerunner.control import (
    BatteryConfig,
    BlockadeConfig,
    CautionConfig,
    FollowerConfig,
    MissionConfig,
    PlannerConfig,
    SafetyConfig,
    SurroundingsConfig,
    VelocityLimits,
    stopping_distance,
)
from tablerunner.control.fuzzy_controller import DetourConfig

DOCS = Path(__file__).parents[4] / 'docs'


def expected_rows(cls: type[Config], prefix: str) -> list[str]:
    """Return the table that documents a record."""
    rows = []
    for field in dataclasses.fields(cls):
        info = parameters_of(cls)[field.name][1]
        default = field.default
        shown = str(default).lower() if isinstance(default, bool) else f'{default:g}'
        rows.append(f'| `{prefix}{field.name}` | {shown} | {info.unit} | {info.description} |')
    return rows


@pytest.mark.parametrize(
    ('page', 'cls', 'prefix'),
    [
        ('safety.md', SafetyConfig, 'safety.'),
        ('safety.md', VelocityLimits, 'limits.'),
        ('navigation.md', PlannerConfig, 'planner.'),
        ('navigation.md', FollowerConfig, 'follower.'),
        ('navigation.md', MissionConfig, 'mission.'),
        ('navigation.md', BatteryConfig, 'battery.'),
        ('navigation.md', BlockadeConfig, 'blockade.'),
        ('navigation.md', CautionConfig, 'caution.'),
        ('navigation.md', SurroundingsConfig, 'surroundings.'),
        ('fuzzy.md', DetourConfig, 'detour.'),
    ],
)
def test_parameter_table_is_that_of_the_code(page: str, cls: type[Config], prefix: str) -> None:
    text = (DOCS / page).read_text(encoding='utf-8')
    table = text.split(f'<!-- {cls.__name__} -->\n')[1].split('\n<!-- end -->')[0]
    assert table.splitlines()[2:] == expected_rows(cls, prefix)


def test_table_of_stopping_distances_is_that_of_the_formula() -> None:
    text = (DOCS / 'safety.md').read_text(encoding='utf-8')
    config = SafetyConfig()
    for speed in (0.12, 0.3, 0.6):
        rest = stopping_distance(speed, config.delay, config.deceleration)
        near = stopping_distance(speed, config.delay, config.deceleration, config.approach_speed)
        assert f'| {speed:.2f} | {rest:.3f} | {near:.3f} |' in text
