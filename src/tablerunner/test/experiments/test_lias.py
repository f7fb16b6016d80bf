"""The trolley recording, and a made-up one in its format."""

import os
from pathlib import Path

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.experiments.lias import calibrate, run_lias
from tablerunner.experiments.lias_recording import FOLDER, read_lias

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope='module')
def data() -> Path:
    given = os.environ.get('TABLERUNNER_DATA')
    folder = Path(given) if given else ROOT.parent / 'shared' / 'data'
    if not (folder / FOLDER).is_dir():
        pytest.skip(f'the trolley recording is not in {folder} (TABLERUNNER_DATA names it)')
    return folder


def write_recording(folder: Path, bias: float = 0.2) -> Path:
    """Write a turn on a circle, exact but for a bias, in the recording's format."""
    anchors = np.array([[-3, 3, 1.0], [3, 3, 1.0], [3, -3, 1.0], [-3, -3, 1.0]])
    tags = np.array([[-0.1, -0.14, 0.0], [-0.1, 0.14, 0.0], [0.2, 0.14, 0.0]])
    times = np.linspace(0.0, 20.0, 401)
    heading = 0.3 * times
    place = np.column_stack([np.sin(heading), -np.cos(heading), np.full(len(times), 0.9)])
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x = place[:, :1] + cos * tags[:, 0] - sin * tags[:, 1]
    y = place[:, 1:2] + sin * tags[:, 0] + cos * tags[:, 1]
    at = np.stack([x, y, np.full_like(x, 0.9)], axis=-1)
    ranges = np.linalg.norm(at[:, None] - anchors[None, :, None], axis=3) + bias
    zero = np.zeros(len(times))
    truth = np.column_stack([times, place, zero, np.cos(heading / 2), np.sin(heading / 2), zero])
    target = folder / FOLDER
    target.mkdir(parents=True)
    for name, rows in (
        ('anchors.csv', np.column_stack([np.arange(4), anchors])),
        ('tags_body_frame.csv', np.column_stack([np.arange(3), tags])),
        ('fast_uwb_20Hz.csv', np.column_stack([times, ranges.reshape(len(times), -1)])),
        ('fast_gt_30Hz.csv', truth),
    ):
        np.savetxt(target / name, rows, delimiter=',', header='h', comments='')
    return folder


def test_made_up_recording_is_solved_exactly(tmp_path):
    """Geometry, columns, halves and calibration are right together, or this is not zero."""
    outcome = run_lias(write_recording(tmp_path), lambda done, count: None)
    assert outcome.row('tag 0, nonlinear, as measured, RMSE').measured.mean > 0.01
    for name in ('tag 0, nonlinear, bias of each anchor, RMSE', 'three tags, position, RMSE'):
        assert outcome.row(name).measured.mean == pytest.approx(0.0, abs=1e-3)
    assert outcome.row('three tags, heading, RMSE').measured.mean == pytest.approx(0.0, abs=0.1)


def test_calibrate_looks_at_the_first_half_only(tmp_path):
    recording = read_lias(write_recording(tmp_path) / FOLDER)
    before = calibrate(recording, 200, 'bias')
    recording.ranges[200:] += 5.0
    assert np.array_equal(calibrate(recording, 200, 'bias')[:200], before[:200])
    assert before - recording.true_ranges() == pytest.approx(0.0, abs=1e-6)


def test_recording_bounds_hold(data):
    """Measured: 0.084 m with biases, 0.081 m with scales too; asked 0.14 m."""
    outcome = run_lias(data, lambda done, count: None)
    assert outcome.holds
    assert outcome.row('three tags, heading, RMSE').measured.mean < 7.0


def test_recording_is_read_the_way_that_its_ranges_agree_with(data):
    """By the header's order of the quaternion the residuals scatter twice as much (0.137 m)."""
    recording = read_lias(data / FOLDER)
    residual = recording.ranges - recording.true_ranges()
    residual -= np.nanmedian(residual, axis=0)
    assert np.nanstd(residual[np.abs(residual) < 0.5]) < 0.09


def test_missing_and_malformed_files_are_named(tmp_path):
    with pytest.raises(ConfigError, match=r'anchors\.csv'):
        read_lias(tmp_path)
    folder = write_recording(tmp_path) / FOLDER
    (folder / 'fast_gt_30Hz.csv').write_text('h\n1,2,3\n')
    with pytest.raises(ConfigError, match='lines of 8 numbers') as caught:
        read_lias(folder)
    assert caught.value.source.endswith('fast_gt_30Hz.csv')
    (folder / 'fast_gt_30Hz.csv').write_text('h\n1,2,3\n1,2\n')
    with pytest.raises(ConfigError, match='a table'):
        read_lias(folder)
