"""`replay` of several estimators, with a smoother, from a time on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import replay
from tablerunner.bags.smoothing import smooth_replay, smoothed_errors
from tablerunner.bags.writer import BagWriter
from tablerunner.cli import main as cli
from tablerunner.cli.replay_options import estimator_names, find_scenario, replay_config
from tablerunner.errors import ConfigError
from tablerunner.estimation import ESTIMATORS
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import OdometrySample, RangeSample

PLACES = {'A0': (0.0, 0.0), 'A1': (8.0, 0.0), 'A2': (8.0, 8.0), 'A3': (0.0, 8.0)}
FIRST = 20_000_000


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of twenty seconds on a winding way between four anchors, with its truth."""
    folder = tmp_path_factory.mktemp('bags') / 'bag'
    rng = np.random.default_rng(7)
    true, odom = Pose2(2.0, 3.0, 0.5), Pose2()
    with BagWriter(folder) as writer:
        for topic in ('odom', 'uwb/ranges', 'ground_truth'):
            writer.add_topic(topic, CONTRACT[topic].msgtype)
        for step in range(1, 1000):
            stamp = step * FIRST
            turn = 0.012 * np.cos(0.01 * step)
            true = advance(true, Motion(0.008, turn, 0.02))
            odom = advance(odom, Motion(0.008 * rng.normal(1.0, 0.1), turn, 0.02))
            told = OdometrySample(
                stamp, odom, 0.4, turn / 0.02, np.eye(3) * 1e-4, np.eye(2) * 1e-4
            )
            writer.write('odom', stamp, messages.odometry_message(told, 'odom', 'base_link'))
            real = OdometrySample(stamp, true, 0.4, turn / 0.02, np.zeros((3, 3)), np.eye(2))
            truth = messages.odometry_message(real, 'map', 'base_link')
            writer.write('ground_truth', stamp, truth)
            if step % 4 == 0:
                name = f'A{step // 4 % 4}'
                distance = np.hypot(true.x - PLACES[name][0], true.y - PLACES[name][1])
                measured = float(distance + rng.normal(0.05, 0.1))
                sample = RangeSample(stamp, name, 'tag', step, measured, 0.01)
                writer.write('uwb/ranges', stamp, messages.range_message(sample, 'uwb_tag'))
    (folder / 'scenario.yaml').write_text(
        'name: flat\nrobot: {tag_position: [0.0, 0.0, 0.0], ultrasonics: []}\nanchors:\n'
        + ''.join(
            f'- {{id: {name}, position: [{x}, {y}, 0.0]}}\n' for name, (x, y) in PLACES.items()
        )
    )
    return folder


def test_smooth_gives_figures_beside_the_filters(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the first odometry on, and smaller; the filter's own are what they are without."""
    plain, both = tmp_path / 'plain.json', tmp_path / 'both.json'
    assert cli.main(['replay', str(bag), '--json', str(plain)]) == 0
    assert 'smoothed' not in capsys.readouterr().out
    arguments = ['replay', str(bag), '--smooth', '--from', '5', '--json', str(both)]
    assert cli.main(arguments) == 0
    printed = capsys.readouterr().out
    without, found = json.loads(plain.read_text()), json.loads(both.read_text())
    assert 'smoothed' not in without
    for name in ('rmse', 'mean', 'max', 'final', 'compared', 'nis', 'accepted'):
        assert found[name] == without[name]
    smoothed = found['smoothed']
    assert smoothed['compared'] == 999 > found['compared']
    assert smoothed['rmse'] < 0.9 * found['rmse']
    assert smoothed['final'] == pytest.approx(found['final'], abs=1e-9)
    assert found['from_seconds'] == smoothed['from_seconds'] == 5.0
    for own, title in ((found, 'position error'), (smoothed, 'smoothed')):
        assert f'{title:<14} rmse {own["rmse"]:.3f} m, mean {own["mean"]:.3f} m' in printed
        assert f'from 5 s on    rmse {own["rmse_from"]:.3f} m, mean {own["mean_from"]:.3f} m' in (
            printed
        )


def test_figures_from_a_time_are_of_the_errors_after_it(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'figures.json'
    assert cli.main(['replay', str(bag), '--from', '12', '--json', str(file)]) == 0
    found = json.loads(file.read_text())
    with BagReader(bag) as reader:
        result = replay(reader, replay_config(find_scenario(bag, None), 'ekf', '', ''))
    late = result.errors.distances[result.errors.stamps >= FIRST + 12_000_000_000]
    assert len(late) > 100
    assert found['rmse_from'] == pytest.approx(float(np.sqrt(np.mean(late**2))))
    assert found['mean_from'] == pytest.approx(float(np.mean(late)))
    assert found['max_from'] == pytest.approx(float(np.max(late)))
    assert found['rmse'] != pytest.approx(found['rmse_from'])


def test_all_estimators_stand_side_by_side(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line and an entry for each, with the figures that it has alone."""
    file, alone = tmp_path / 'all.json', tmp_path / 'ukf.json'
    arguments = ['replay', str(bag), '--estimator', 'all', '--smooth', '--json', str(file)]
    assert cli.main(arguments) == 0
    printed = capsys.readouterr().out
    found = json.loads(file.read_text())
    assert [item['estimator'] for item in found] == list(ESTIMATORS)
    assert [item['estimator'] for item in found if 'smoothed' in item] == [
        'ekf',
        'ukf',
        'dead_reckoning',
        'iekf',
        'lm_iekf',
    ]
    assert cli.main(['replay', str(bag), '--estimator', 'ukf', '--json', str(alone)]) == 0
    ukf = json.loads(alone.read_text())
    for name in ('rmse', 'max', 'initialised_after', 'nis'):
        assert found[1][name] == ukf[name]
    lines = printed.splitlines()
    for item in found:
        (line,) = [line for line in lines if line.split()[:1] == [item['estimator']]][:1]
        assert line.split()[2:6] == [
            f'{item[name]:.3f}' for name in ('rmse', 'mean', 'max', 'final')
        ]
    assert sum('smoothed' in line for line in lines) == 5


def test_smoothed_path_ends_where_the_filter_ends_and_has_its_covariances(bag: Path) -> None:
    """A row for each instant, strictly later; no less certain than the filter."""
    from dataclasses import replace as changed

    config = changed(replay_config(find_scenario(bag, None), 'ekf', '', ''), keep=True)
    with BagReader(bag) as reader:
        result = replay(reader, config)
    path, settled = smooth_replay(result), result.estimates.settled()
    assert (np.diff(path.stamps) > 0).all()
    assert path.stamps[0] == FIRST
    np.testing.assert_array_equal(path.poses[-1], settled.poses[-1])
    rows = np.searchsorted(path.stamps, settled.stamps)
    np.testing.assert_array_equal(path.stamps[rows], settled.stamps)
    smaller = path.covariances[rows][:, 0, 0] - settled.covariances[:, 0, 0]
    assert smaller.max() < 1e-9
    errors = smoothed_errors(result)
    assert len(errors.stamps) == 999
    np.testing.assert_array_equal(errors.covariances, path.covariances)
    with pytest.raises(ConfigError, match='expected one of ekf, ukf, dead_reckoning'):
        smooth_replay(changed(result, estimator='kf'))


@pytest.mark.parametrize(
    ('text', 'names'),
    [
        ('ekf', ('ekf',)),
        ('ukf, ekf,ukf', ('ukf', 'ekf')),
        ('all', tuple(ESTIMATORS)),
    ],
)
def test_estimator_names(text: str, names: tuple[str, ...]) -> None:
    assert estimator_names(text) == names


@pytest.mark.parametrize('text', ['', 'ekf,', 'ekf,all', 'EKF'])
def test_estimator_names_unknown_raises(text: str) -> None:
    with pytest.raises(ConfigError, match='estimator: got'):
        estimator_names(text)
