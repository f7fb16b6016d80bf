"""`tablerunner explain-rule`: what it prints, writes and draws, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tablerunner.cli import main as cli
from tablerunner.control.fuzzy import base_path, load_base

VALUES = ('--set', 'deviation=0.12', '--set', 'heading_error=-5')
TRACK = ('explain-rule', '--base', 'sun_track')


@pytest.fixture(autouse=True)
def only_own_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the commands of other packages away."""
    monkeypatch.setattr(cli, 'entry_points', lambda group: [])


def test_decision_is_printed_with_its_reasons(capsys: pytest.CaptureFixture[str]) -> None:
    """0.12 m is 0.6 of the way from Z to LS, -5 deg a third of that from Z to RS."""
    assert cli.main([*TRACK, *VALUES]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == [
        'base     sun_track',
        'input    deviation     = 0.12 m: LS 0.600  Z 0.400',
        'input    heading_error = -5 deg: Z 0.667  RS 0.333',
        'fired    0.600  36.0 %  track table, LS/Z: deviation LS, heading_error Z -> RS (-0.5)',
    ]
    assert [line[:14] for line in lines[3:-1]] == [
        f'fired    {strength}' for strength in ('0.600', '0.400', '0.333', '0.333')
    ]
    expected = (0.6 * -0.5 + 0.0 + 0.0 + 0.5 / 3) / (0.6 + 0.4 + 2 / 3)
    assert lines[-1] == f'output   difference = {expected:.4f}'


def test_decision_is_written_as_json(tmp_path: Path) -> None:
    file = tmp_path / 'out' / 'decision.json'
    assert (
        cli.main([*TRACK, '--set', 'deviation=9', VALUES[2], VALUES[3], '--json', str(file)]) == 0
    )
    content = json.loads(file.read_text())
    assert content['inputs']['deviation'] == {
        'given': 9.0,
        'used': 0.4,
        'unit': 'm',
        'degrees': {'LM': 1.0, 'LS': 0.0, 'Z': 0.0, 'RS': 0.0, 'RM': 0.0},
    }
    assert [rule['then'] for rule in content['fired']] == ['RB', 'RS']
    shares = sum(rule['share'] * rule['centre'] for rule in content['fired'])
    assert shares == pytest.approx(content['output']['value'])
    assert content['output']['value'] == pytest.approx(load_base('sun_track').infer_one(9.0, -5.0))


def test_bases_are_listed_and_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(['explain-rule']) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert names == ['lv_corner', 'lv_speed', 'sun_track']
    file = tmp_path / 'base.json'
    assert cli.main(['explain-rule', '--base', 'lv_speed', '--json', str(file)]) == 0
    assert 'rules    24, joined by min, output by weighted average' in capsys.readouterr().out
    content = json.loads(file.read_text())
    assert len(content['rules']) == 24
    assert content['rules'][0] == {
        'rule': 'table IV, I/N',
        'when': {
            'left_front': 'FA',
            'front': 'FA',
            'right_front': 'FA',
            'target_distance': 'N',
        },
        'then': 'S',
    }


def test_base_of_a_user_is_explained_and_its_faults_are_placed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = base_path('sun_track').read_text()
    mine = tmp_path / 'mine.yaml'
    mine.write_text(text)
    assert cli.main(['explain-rule', '--base', str(mine), *VALUES]) == 0
    assert 'base     mine' in capsys.readouterr().out
    mine.write_text(text.replace('RS: [RB, RS, Z,', 'RS: [RB, RS, Q,'))
    assert cli.main(['explain-rule', '--base', str(mine), *VALUES]) == 2
    line = next(n for n, row in enumerate(text.splitlines(), 1) if 'RS: [RB, RS, Z,' in row)
    error = capsys.readouterr().err
    assert f"{mine}:{line}: tables[0].cells.RS[2]: got 'Q', expected a set of difference" in error


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--base', 'sun_trak'), 'did you mean sun_track?'),
        (('--base', 'sun_track', '--set', 'deviation'), "--set: got 'deviation', expected NAME="),
        (('--base', 'sun_track', '--set', 'deviation=far'), 'NAME=VALUE with a number'),
        (('--base', 'sun_track', '--set', '=3'), 'NAME=VALUE'),
        (('--base', 'sun_track', *VALUES, '--set', 'deviation=1'), 'each input once'),
        (('--base', 'sun_track', '--set', 'deviation=1'), "heading_error: got 'nothing'"),
        (('--base', 'sun_track', '--set', 'deviation=nan', *VALUES[2:]), 'deviation: got nan'),
        (('--base', 'sun_track', *VALUES, '--set', 'wind=1'), 'wind: got 1.0, expected an input'),
        (('--base', 'sun_track', *VALUES, '--over', 'deviation'), '--over'),
        (('--base', 'sun_track', *VALUES, '--over', 'deviation,deviation'), '--over'),
        (('--base', 'sun_track', *VALUES, '--over', 'deviation,wind'), 'two of the inputs'),
        (('--base', 'sun_track', *VALUES, '--plot', '/proc/none/x.png'), 'a file to write'),
    ],
)
def test_bad_input_is_refused_with_exit_code_2(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(['explain-rule', *arguments]) == 2
    assert words in capsys.readouterr().err


def test_picture_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from matplotlib import image

    file = tmp_path / 'track.png'
    assert cli.main([*TRACK, *VALUES, '--plot', str(file)]) == 0
    assert f'picture  {file}' in capsys.readouterr().out
    assert image.imread(file).shape[:2] == (528, 1100)
