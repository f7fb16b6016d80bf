"""The command that compares: files, table, and what it refuses."""

import csv
import io
import json

import pytest
from rich.console import Console

from tablerunner.cli import main as cli
from tablerunner.cli.compare import table_of
from tablerunner.cli.scenario_file import find_scenario_file
from tablerunner.errors import ConfigError

ROOM = """\
name: small
start: [2.0, 2.0, 1.5708]
walls:
  - {name: outer, closed: true, points: [[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]]}
anchors:
  - {id: A0, position: [0.0, 0.0, 2.25]}
  - {id: A1, position: [8.0, 0.0, 2.25]}
  - {id: A2, position: [8.0, 6.0, 2.25]}
people:
  - {name: somebody, route: [[4.0, 3.0]]}
routes:
  up: [[2.0, 2.0], [2.0, 4.0]]
  right: [[2.0, 2.0], [5.0, 2.0]]
"""


@pytest.fixture(autouse=True)
def only_own_commands(monkeypatch):
    """Keep the commands of other packages away."""
    monkeypatch.setattr(cli, 'entry_points', lambda group: [])


@pytest.fixture
def room(tmp_path):
    """Return a scenario file."""
    file = tmp_path / 'small.yaml'
    file.write_text(ROOM)
    return file


def run(room, *options):
    return cli.main(['compare', '--scenario', str(room), '--workers', '1', *options])


def test_figures_pictures_and_lines_are_written(room, tmp_path, capsys):
    out = tmp_path / 'out'
    options = ('--estimators', 'ekf,dead_reckoning', '--seeds', '2', '--first-seed', '7')
    assert run(room, *options, '--out', str(out), '--csv', str(tmp_path / 'a.csv')) == 0
    figures = json.loads((out / 'compare.json').read_text())
    assert figures['seeds'] == [7, 8]
    assert [item['estimator'] for item in figures['estimators']] == ['ekf', 'dead_reckoning']
    assert 0.3 < figures['estimators'][0]['ratio_to_bound'] < 3.0
    assert figures['estimators'][1]['nis_mean'] is None
    assert figures['matched'] is True
    with (tmp_path / 'a.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['seed'], row['estimator']) for row in rows] == [
        ('7', 'ekf'),
        ('7', 'dead_reckoning'),
        ('8', 'ekf'),
        ('8', 'dead_reckoning'),
    ]
    for name in ('compare', 'ekf', 'dead_reckoning'):
        assert (out / f'{name}.png').read_bytes().startswith(b'\x89PNG')
    printed = capsys.readouterr().out
    assert 'bound' in printed
    assert 'of the ranges blocked' in printed


def test_clear_sight_and_shipped_settings_are_told(room, tmp_path, capsys):
    options = (
        '--estimators',
        'ekf',
        '--seeds',
        '1',
        '--no-nlos',
        '--defaults',
        '--route',
        'right',
    )
    assert run(room, *options, '--out', str(tmp_path), '--json', str(tmp_path / 'f.json')) == 0
    assert 'all ranges clear; noise and priors as shipped' in capsys.readouterr().out
    figures = json.loads((tmp_path / 'f.json').read_text())
    assert figures['blocked'] == 0.0
    assert figures['matched'] is False


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (('--estimators', 'oracle'), 'ekf, ukf'),
        (('--route', 'down'), 'up, right'),
        (('--speed', '0'), '--speed'),
    ],
)
def test_what_there_is_not_is_refused(room, capsys, options, words):
    assert run(room, *options) == 2
    assert words in capsys.readouterr().err


def test_scenario_is_found_by_path_or_by_installed_name(tmp_path, monkeypatch):
    shared = tmp_path / 'share' / 'tablerunner_bringup' / 'scenarios'
    shared.mkdir(parents=True)
    (shared / 'cafe.yaml').write_text(ROOM)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert find_scenario_file('cafe') == shared / 'cafe.yaml'
    assert find_scenario_file(str(shared / 'cafe.yaml')) == shared / 'cafe.yaml'
    with pytest.raises(ConfigError, match='one of cafe'):
        find_scenario_file('bar')
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    with pytest.raises(ConfigError, match='no scenarios are installed'):
        find_scenario_file('cafe')


def test_table_is_whole_on_120_columns(room):
    from tablerunner.experiments.compare import Setup, compared, one_seed
    from tablerunner.scenario import load_scenario

    setup = Setup(load_scenario(room), ((2.0, 3.0),), ('ekf', 'dead_reckoning'))
    console = Console(file=io.StringIO(), width=120)
    console.print(table_of(compared(setup, [one_seed(1, setup)])))
    text = console.file.getvalue()
    assert '…' not in text
    assert 'dead_reckoning' in text
