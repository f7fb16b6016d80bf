"""Configuration is built strictly, and every complaint names its place."""

from dataclasses import dataclass

import pytest

from tablerunner.config import Config, Document, build, load, parameter, to_mapping
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class Mast(Config):
    """A part of a site."""

    name: str = parameter(description='Name')
    position: tuple[float, float] = parameter(description='x, y', unit='m', low=-10.0)
    kind: str = parameter('pole', description='Kind', choices=('pole', 'wall'))


@dataclass(frozen=True)
class Site(Config):
    """A file's worth of configuration."""

    masts: tuple[Mast, ...] = parameter(description='Masts')
    rate: float = parameter(10.0, description='Rate', unit='Hz', above=0.0, high=100.0)
    count: int = parameter(3, description='Count', low=1)
    active: bool = parameter(True, description='Active')
    limits: dict[str, float] = parameter(factory=dict, description='Limits by name')

    def check(self) -> None:
        """Refuse a fourth mast."""
        if len(self.masts) > 3:
            raise ConfigError('masts', len(self.masts), 'at most three')


GOOD = """\
rate: 5
masts:
  - name: a
    position: [1, 2.5]
limits: {speed: 1}
"""


def test_build_good_document_gives_typed_values():
    """Whole numbers become floats where floats are meant; defaults fill the rest."""
    site = build(Site, Document.parse(GOOD, 'site.yaml'))
    assert site.masts[0].position == (1.0, 2.5)
    assert isinstance(site.masts[0].position[0], float)
    assert (site.rate, site.count, site.active, site.limits) == (5.0, 3, True, {'speed': 1.0})


def test_to_mapping_round_trip_gives_the_same_config():
    """What is written out as plain data builds the same record again."""
    site = build(Site, Document.parse(GOOD))
    assert build(Site, Document(to_mapping(site))) == site


@pytest.mark.parametrize(
    ('text', 'line', 'field', 'words'),
    [
        ('masts: []\nrate: fast', 2, 'rate', "got 'fast', expected a finite number"),
        ('masts: []\nrate: .nan', 2, 'rate', 'got nan'),
        ('masts: []\nrate: 0', 2, 'rate', 'above 0 and at most 100 .Hz.'),
        ('masts: []\nrate: true', 2, 'rate', 'got True'),
        ('masts: []\ncount: 2.5', 2, 'count', 'got 2.5, expected a whole number'),
        ('masts: []\ncount: 0', 2, 'count', 'at least 1'),
        ('masts: []\nactive: 1', 2, 'active', 'true or false'),
        ('masts: []\n\nrat: 1', 3, 'rat', 'did you mean rate'),
        ('rate: 1', 1, 'masts', 'Masts'),
        ('masts: 7', 1, 'masts', 'a list'),
        ('masts:\n- position: [1, 2]', 2, 'masts[0].name', 'Name'),
        ('masts:\n- name: a\n  position: [1, x]', 3, 'masts[0].position[1]', "got 'x'"),
        ('masts:\n- name: a\n  position: [1]', 3, 'masts[0].position', '2 values'),
        ('masts:\n- {name: 7, position: [1, 2]}', 2, 'masts[0].name', 'text'),
        ('masts:\n- {name: a, position: [1, 2], kind: rope}', 2, 'masts[0].kind', 'pole, wall'),
        ('masts: []\nlimits: {speed: high}', 2, 'limits.speed', "got 'high'"),
        ('rate: 1\nrate: 2\nmasts: []', 2, 'rate', 'each key once'),
        ('masts: [', 1, '', 'YAML'),
    ],
)
def test_build_bad_document_names_file_line_field_and_value(text, line, field, words):
    """Every kind of mistake is reported with its place."""
    with pytest.raises(ConfigError, match=words) as caught:
        build(Site, Document.parse(text, 'site.yaml'))
    assert (caught.value.source, caught.value.line) == ('site.yaml', line)
    assert caught.value.field == field
    assert str(caught.value).startswith(f'site.yaml:{line}: ')


def test_build_rule_between_fields_is_located():
    """A rule of `check` is reported on the line of the field that it names."""
    text = 'rate: 1\nmasts:\n' + '- {name: a, position: [1, 2]}\n' * 4
    with pytest.raises(ConfigError, match='at most three') as caught:
        build(Site, Document.parse(text, 'site.yaml'))
    assert caught.value.line == 2


def test_load_missing_file_names_it(tmp_path):
    """A file that is not there is named, in one sentence."""
    with pytest.raises(ConfigError, match=r'none\.yaml.*readable file'):
        load(Site, tmp_path / 'none.yaml')


def test_replace_checks_again():
    """A changed copy obeys the same bounds."""
    site = build(Site, Document.parse(GOOD))
    assert site.replace(rate=7.0).rate == 7.0
    with pytest.raises(ConfigError, match='rate'):
        site.replace(rate=-1.0)
