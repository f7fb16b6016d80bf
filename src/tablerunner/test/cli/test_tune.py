"""`tune` as a command: what it prints is a parameter file with settings that exist, and helps."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.writer import BagWriter
from tablerunner.cli import main as cli
from tablerunner.cli.tune_report import Judged, TuneReport, number
from tablerunner.config import Document, build
from tablerunner.estimation import EstimatorConfig
from tablerunner.estimation.likelihood import RangeInnovations
from tablerunner.estimation.tuning import RANGE_STD, Tuned, Tuning, Verdict
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import OdometrySample, RangeSample
from tablerunner.uwb import RangerConfig

PLACES = {'A0': (0.0, 0.0), 'A1': (8.0, 0.0), 'A2': (8.0, 8.0), 'A3': (0.0, 8.0)}


def write_bag(folder: Path, seconds: float) -> Path:
    """Write a drive whose ranges tell a deviation of 0.3 m and have one of 0.1 m."""
    rng = np.random.default_rng(7)
    true, odom = Pose2(2.0, 3.0, 0.5), Pose2()
    with BagWriter(folder) as writer:
        for topic in ('odom', 'uwb/ranges'):
            writer.add_topic(topic, CONTRACT[topic].msgtype)
        for step in range(1, round(seconds * 20)):
            stamp = step * 50_000_000
            turn = 0.03 * math.cos(0.025 * step)
            true = advance(true, Motion(0.02 + rng.normal(0, 0.003), turn, 0.05))
            odom = advance(odom, Motion(0.02, turn, 0.05))
            told = OdometrySample(
                stamp, odom, 0.4, turn / 0.05, np.eye(3) * 1e-4, np.eye(2) * 1e-4
            )
            writer.write('odom', stamp, messages.odometry_message(told, 'odom', 'base_link'))
            name = f'A{step % 4}'
            distance = math.hypot(true.x - PLACES[name][0], true.y - PLACES[name][1])
            sample = RangeSample(stamp, name, 'tag', step, distance + rng.normal(0, 0.1), 0.09)
            writer.write('uwb/ranges', stamp, messages.range_message(sample, 'uwb_tag'))
    (folder / 'scenario.yaml').write_text(
        'name: flat\nrobot: {tag_position: [0.0, 0.0, 0.0], ultrasonics: []}\nanchors:\n'
        + ''.join(
            f'- {{id: {name}, position: [{x}, {y}, 0.0]}}\n' for name, (x, y) in PLACES.items()
        )
    )
    return folder


def test_tune_writes_parameters_that_make_ranges_consistent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, file, figures = write_bag(tmp_path / 'bag', 25.0), tmp_path / 'x/t.yaml', tmp_path / 'j'
    assert cli.main(['tune', str(bag), '--out', str(file), '--json', str(figures)]) == 0
    printed = capsys.readouterr().out
    text, found = file.read_text(), json.loads(figures.read_text())
    assert text in printed
    content = yaml.safe_load(text)
    values = {item['name']: item for item in found['parameters']}
    told = values['uwb_driver.range_std']
    assert told['before'] == pytest.approx(0.3)
    assert told['after'] == pytest.approx(0.1, rel=0.12)  # three deviations: 3 / sqrt(2 * 499)
    assert told['verdict'] == 'tuned'
    assert content['/**/uwb_driver']['ros__parameters'] == {
        'range_std': pytest.approx(told['after'], rel=0.01)
    }
    assert values['filter.gyro_bias_walk']['verdict'] == 'held'
    assert '# gyro_bias_walk: 0.0002  # held' in text
    before, after = found['before'], found['after']
    assert before['nis'] < 0.3
    assert after['nis_low'] < after['nis'] < after['nis_high']
    assert abs(after['lag_one']) < after['lag_one_bound']
    assert after['log_likelihood'] > before['log_likelihood'] + 0.3
    assert f'{after["nis"]:.3f}' in printed


def test_tune_too_little_data_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No start, and a start but no more: exit code 1 and why."""
    assert cli.main(['tune', str(write_bag(tmp_path / 'short', 0.4))]) == 1
    assert 'never found its start' in capsys.readouterr().err
    short = str(write_bag(tmp_path / 'brief', 1.5))
    assert cli.main(['tune', short, '--start', '2,3,0.5']) == 1
    assert 'ranges are too few to tune noise: at least 50' in capsys.readouterr().err


def tuned(name: str, verdict: Verdict, told: bool = False) -> Tuned:
    """Return a parameter that was 0.1 and is 0.00012345 when it was tuned."""
    after = 0.00012345 if verdict is Verdict.TUNED else 0.1
    return Tuned(name, '', 0.1, after, 1.5, verdict, told)


def report(*parameters: Tuned) -> TuneReport:
    """Return a report of these parameters."""
    nothing = RangeInnovations(
        np.array(['A0'] * 4),
        np.array([0.1, -0.2, 0.1, 9.0]),
        np.full(4, 0.01),
        np.array([True, True, True, False]),
        np.full(4, -1.0),
    )
    tuning = Tuning(parameters, EstimatorConfig(), 1.0, nothing, nothing, 7)
    return TuneReport(tuning, Path('bag'), 'ekf', 1.0)


@pytest.mark.parametrize('told', [False, True])
@pytest.mark.parametrize(
    'own', [set(), {RANGE_STD}, {'motion.distance'}, {'gyro_bias_walk', RANGE_STD}]
)
def test_parameter_text_holds_what_was_tuned_and_nothing_empty(own: set[str], told: bool) -> None:
    """A heading over nothing but comments would be null, which a node refuses."""
    names = (RANGE_STD, 'motion.distance', 'motion.heading_per_turn', 'gyro_bias_walk')
    items = [
        tuned(name, Verdict.TUNED if name in own else Verdict.HELD, told and name == RANGE_STD)
        for name in names
    ]
    text = report(*items).parameter_text()
    content = yaml.safe_load(text) or {}
    expected = set(own)
    for node in content.values():
        assert node['ros__parameters']
    driver = content.get('/**/uwb_driver', {}).get('ros__parameters', {})
    fusion = content.get('/**/fusion_node', {}).get('ros__parameters', {})
    if told and RANGE_STD in expected:
        expected.remove(RANGE_STD)
        assert build(RangerConfig, Document(driver)).range_std == 0.000123
    else:
        assert driver == {}
    if expected:
        config = build(EstimatorConfig, Document(fusion['filter']))
        default = EstimatorConfig()
        assert (config.default_range_std == 0.000123) == (RANGE_STD in expected)
        assert (config.motion.distance == 0.000123) == ('motion.distance' in expected)
        assert (config.gyro_bias_walk == 0.000123) == ('gyro_bias_walk' in expected)
        assert config.motion.heading_per_turn == default.motion.heading_per_turn
    else:
        assert fusion == {}
    for name in names:
        assert name.split('.')[-1] in text


def test_judged_leaves_refused_ranges_out_of_nis_and_whiteness() -> None:
    judged = Judged.of(report().tuning.before)
    assert judged.accepted == 0.75
    assert judged.nis.mean == pytest.approx(2.0)
    assert judged.whiteness.pairs == 2
    assert judged.log_likelihood == -1.0


def test_report_without_a_pair_is_still_one() -> None:
    """A correlation that nothing is known of is no figure, and no error."""
    whole = report(tuned('motion.distance', Verdict.TUNED))
    lonely = replace(whole.tuning.before, anchors=np.array(list('abcd')))
    single = replace(whole, tuning=replace(whole.tuning, before=lonely, after=lonely))
    assert any('nan' in line for line in single.lines())


@pytest.mark.parametrize(
    ('value', 'text'),
    [(0.0002, '0.0002'), (1e-5, '0.00001'), (0.123456, '0.123'), (3.0, '3.0'), (12.34, '12.3')],
)
def test_number_has_a_point_and_no_exponent(value: float, text: str) -> None:
    assert number(value) == text
    assert isinstance(yaml.safe_load(number(value)), float)
