"""`tablerunner drive-test`: the table, saved rooms that can be driven again, exit codes."""

import json
from dataclasses import replace

import pytest

from tablerunner.cli import main as cli
from tablerunner.experiments import drive_test as experiment
from tablerunner.experiments.drive_room import drive_room
from tablerunner.experiments.random_room import make_drive_room

SEED = 10  # a short tour; one table stands behind a closed door


@pytest.fixture(autouse=True)
def only_own_commands(monkeypatch):
    """Keep the commands of other packages away."""
    monkeypatch.setattr(cli, 'entry_points', lambda group: [])


@pytest.fixture(scope='module')
def drive():
    return drive_room(make_drive_room(SEED), 'fuzzy')


def run(*options):
    return cli.main(['drive-test', *options])


def pretend(monkeypatch, *drives):
    """Let tours be made up instead of driven."""
    found = experiment.DriveTest(drives)
    monkeypatch.setattr(experiment, 'run_drive_test', lambda *arguments: found)


def test_rooms_are_driven_and_judged(tmp_path, capsys):
    out = tmp_path / 'out'
    assert run('--rooms', '1', '--first-seed', str(SEED), '--jobs', '1', '-o', str(out)) == 0
    told = capsys.readouterr().out
    assert 'drive-test; 1 rooms from 10' in told
    assert 'kept' in told
    assert 'MISSED' not in told
    figures = json.loads((out / 'drive_test.json').read_text())
    assert figures['holds'] is True
    assert figures['rooms'] == [SEED]
    assert figures['drives'][0]['faults'] == []
    assert [file.name for file in out.iterdir()] == ['drive_test.json']  # nothing went wrong


def test_failed_room_is_saved_and_driven_again(tmp_path, capsys, monkeypatch, drive):
    out = tmp_path / 'out'
    pretend(monkeypatch, replace(drive, ended=False), replace(drive, seed=11))
    assert run('--rooms', '2', '-o', str(out), '--json', str(tmp_path / 'a.json')) == 1
    told = capsys.readouterr().out
    assert 'MISSED' in told
    assert 'room 10, fuzzy: still driving' in told
    assert json.loads((tmp_path / 'a.json').read_text())['holds'] is False
    file = out / f'room-{SEED}.yaml'
    assert sorted(out.iterdir()) == [file.with_suffix('.json'), file]
    assert run('--replay', str(file), '-o', str(tmp_path / 'again')) == 0
    told = capsys.readouterr().out
    for time_s, event in drive.events:
        assert f'{time_s:.1f} s  {event}' in told
    assert 'nothing went wrong' in told
    picture = tmp_path / 'again' / f'room-{SEED}-fuzzy.png'
    assert picture.read_bytes()[:4] == b'\x89PNG'


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (('--controller', 'clever'), 'clever'),
        (('--room', '10', '--controller', 'clever'), 'clever'),
        (('--replay', 'nowhere.yaml'), 'nowhere.yaml'),
        (('--rooms', '0'), 'rooms'),
        (('--room', '-1'), 'room'),
        (('--room', '1', '--replay', 'x.yaml'), 'one of --room and --replay'),
    ],
)
def test_bad_input_is_named(options, words, capsys):
    assert run(*options) == 2
    assert words in capsys.readouterr().err
