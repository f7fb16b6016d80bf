"""The command `tablerunner stop-test`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tablerunner.cli.main import main
from tablerunner.experiments import stopping
from tablerunner.experiments.stopping import Stop


@pytest.mark.parametrize(('way_m', 'code'), [(0.2, 0), (0.5, 1)])
def test_stop_test_writes_figures_and_fails_when_a_bound_is_missed(
    way_m: float,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    stop = Stop('emergency', 0.6, way_m, 0.405)
    monkeypatch.setattr(
        stopping,
        'run_seeds',
        lambda run, seeds, progress: [([('stop', stop)], (0, 0)) for _ in seeds],
    )
    figures = tmp_path / 'figures.json'
    options = ['--seeds', '3', '--seed', '7', '-o', str(tmp_path), '--json', str(figures)]
    assert main(['stop-test', *options]) == code
    written = json.loads(figures.read_text())
    assert written['seeds'] == [7, 8, 9]
    assert written['holds'] is (code == 0)
    assert written['rows'][0]['max'] == way_m
    assert (tmp_path / 'stopping.png').stat().st_size > 1000
    assert 'max <= 0.405' in capsys.readouterr().out


def test_stop_test_without_seeds_is_refused() -> None:
    assert main(['stop-test', '--seeds', '0']) == 2
