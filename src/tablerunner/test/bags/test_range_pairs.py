"""Calibration of ranges from a bag: the biases of the simulator come out, bad input is named."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.range_pairs import RangePairs, range_pairs
from tablerunner.bags.reader import BagReader
from tablerunner.bags.writer import BagWriter
from tablerunner.cli.calibrate import fit_all, parameter_text, report
from tablerunner.cli.main import main
from tablerunner.config import Document, build
from tablerunner.errors import BagError, ConfigError
from tablerunner.evaluation.truth_file import read_truth
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import AnchorPlace, Box, RobotGeometry, Scenario
from tablerunner.simulation import Simulator
from tablerunner.simulation.radio import Radio
from tablerunner.types import OdometrySample
from tablerunner.uwb import RangerConfig
from tablerunner.uwb.range_calibration import fit_calibration


@pytest.fixture(scope='module', params=[1])
def drive(request, make_bag, restaurant, tmp_path_factory):
    """Return the bag of a drive, and what the links of its seed really read too long."""
    folder = tmp_path_factory.mktemp('calibrate') / 'bag'
    make_bag(folder, restaurant, request.param, 40.0)
    radio = Simulator(restaurant, request.param).radio
    return folder, radio.bias_m, radio.scale


def test_biases_of_the_simulator_come_out(drive, restaurant):
    """In the middle of the distances driven: within three standard errors and a centimetre."""
    folder, bias, scale = drive
    with BagReader(folder) as bag:
        found = range_pairs(bag, (), restaurant.robot.tag_position)
    assert len(found) == 4
    for item in found:
        fit = fit_calibration(item.true, item.raw)
        middle = float(item.true.mean())
        name = item.anchor.anchor_id
        expected = bias[name] + scale[name] * middle
        error = abs(fit.bias_m + fit.scale * middle - expected)
        assert error < 3.0 * float(fit.deviation(middle)) + 0.01
        assert fit.residual_std_m == pytest.approx(0.08, abs=0.025)


def test_blocked_ranges_are_left_out(drive, restaurant):
    """The pairs that are kept are right but for bias and noise; those behind walls are not."""
    folder, bias, scale = drive
    with BagReader(folder) as bag:
        found = range_pairs(bag, (), restaurant.robot.tag_position)
    assert sum(item.blocked for item in found) > 0
    for item in found:
        name = item.anchor.anchor_id
        rest = item.raw - item.true * (1.0 + scale[name]) - bias[name]
        assert np.mean(np.abs(rest) > 0.4) < 0.02


def test_command_writes_what_the_driver_reads(drive, tmp_path, capsys):
    """The file gives back the printed numbers, and is never written over."""
    folder, bias, _ = drive
    file = tmp_path / 'new' / 'uwb.yaml'
    assert main(['calibrate', 'ranges', str(folder), '-o', str(file)]) == 0
    own = yaml.safe_load(file.read_text())['/**/uwb_driver']['ros__parameters']
    config = build(RangerConfig, Document(own, str(file)))
    assert config.anchor_ids == tuple(bias)
    assert file.with_suffix('.png').read_bytes().startswith(b'\x89PNG')
    printed = capsys.readouterr().out
    assert f'{config.anchor_biases[0]:+.3f} +-' in printed
    assert main(['calibrate', 'ranges', str(folder), '-o', str(file)]) == 2
    assert 'does not exist yet' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('nowhere',), 'there is no bag'),
        (('BAG', '--at', '1,x'), '--at'),
        (('BAG', '--at', '1'), '--at'),
        (('BAG', '--namespace', 'robot2'), 'where the anchors are'),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(drive, tmp_path, capsys, arguments, words):
    given = [str(drive[0]) if item == 'BAG' else item for item in arguments]
    assert main(['calibrate', 'ranges', *given, '-o', str(tmp_path / 'x.yaml')]) == 2
    assert words in capsys.readouterr().err


AIR = 299_702_547.0 / 299_792_458.0
"""The driver counts with light in air, the simulator's flies in empty space."""


@pytest.fixture(scope='module')
def room() -> Scenario:
    """Return four anchors in a bare room; a box stands in it and blocks some ranges."""
    places = {
        'A0': (0.2, 0.2, 2.25),
        'A1': (14.8, 0.2, 2.25),
        'A2': (14.8, 14.8, 2.25),
        'A3': (0.2, 14.8, 2.25),
    }
    return Scenario(
        name='bare',
        boxes=(Box('cupboard', 7.5, 9.0, 4.0, 0.6, height=2.2),),
        anchors=tuple(AnchorPlace(name, place) for name, place in places.items()),
        start=(3.0, 3.0, 0.0),
        robot=RobotGeometry(tag_position=(0.1, -0.05, 1.1), ultrasonics=()),
    )


def write_circle(
    folder: Path,
    room: Scenario,
    seed: int,
    powers: bool = True,
    truth: bool = True,
    still: tuple[float, float] | None = None,
):
    """Write two turns on an ellipse, or a minute at one place, as exchanges.

    Return bias and scale of each link as the driver sees them, and stamps with true poses.
    """
    radio = Radio(room, seed)
    topics = ('uwb/anchors', 'uwb/exchanges', *(('ground_truth',) if truth else ()))
    rows = []
    with BagWriter(folder) as bag:
        for topic in topics:
            bag.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
        anchors = tuple(place.anchor for place in room.anchors)
        bag.write('uwb/anchors', 1, messages.anchors_message(anchors, 1, 'map'))
        for step in range(2400):
            stamp, angle = (step + 1) * 25_000_000, 4.0 * math.pi * step / 2400
            x, y = 7.5 + 5.0 * math.cos(angle), 6.0 + 4.0 * math.sin(angle)
            pose = Pose2(x, y, angle) if still is None else Pose2(*still, 0.0)
            rows.append((stamp, pose))
            if truth:
                sample = OdometrySample(stamp, pose, 0.0, 0.0)
                message = messages.odometry_message(sample, 'map', 'base_link')
                bag.write('ground_truth', stamp, message)
            exchange, _ = radio.exchange(stamp, pose, ())
            if exchange is not None:
                if not powers:
                    exchange = replace(exchange, first_path_power_dbm=float('nan'))
                bag.write('uwb/exchanges', stamp, messages.exchange_message(exchange, 'uwb_tag'))
    bias = {name: value * AIR for name, value in radio.bias_m.items()}
    return bias, {name: (1.0 + value) * AIR - 1.0 for name, value in radio.scale.items()}, rows


@pytest.mark.parametrize('powers', [True, False])
def test_known_biases_and_scales_come_out_within_three_standard_errors(room, tmp_path, powers):
    """Of five seeds and four anchors, with and without a signal that tells what is blocked.

    Errors over standard errors: none above 3 but one in a hundred or so, and 1 on average, so
    that the standard errors are neither too small nor idle.
    """
    ratios = []
    for seed in range(20, 25):
        folder = tmp_path / str(seed)
        bias, scale, _ = write_circle(folder, room, seed, powers)
        with BagReader(folder) as bag:
            found = range_pairs(bag, (), room.robot.tag_position)
        assert (sum(item.blocked for item in found) > 100) == powers
        for item in found:
            fit, name = fit_calibration(item.true, item.raw, blocked=True), item.anchor.anchor_id
            error = np.array([fit.bias_m - bias[name], fit.scale - scale[name]])
            ratios.append(error / np.sqrt(np.diag(fit.covariance)))
            assert fit.residual_std_m == pytest.approx(0.08, rel=0.2)
    assert np.mean(np.abs(ratios) > 3.0) <= 0.025
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.35


def test_truth_from_a_file_is_as_good_as_from_the_bag(room, tmp_path, capsys):
    """The same path in a text file gives the same numbers, with heading and lever arm."""
    folder, file = tmp_path / 'bag', tmp_path / 'path.csv'
    bias, scale, rows = write_circle(folder, room, 7, truth=False)
    lines = [f'{stamp / 1e9:.9f},{p.x!r},{p.y!r},{p.heading!r}' for stamp, p in rows]
    file.write_text('\n'.join(['t,x,y,heading', *lines]) + '\n')
    with BagReader(folder) as bag:
        found = range_pairs(bag, (), room.robot.tag_position, truth=read_truth(file))
    for item in found:
        fit, name = fit_calibration(item.true, item.raw, blocked=True), item.anchor.anchor_id
        middle = float(np.mean(item.true))
        error = fit.bias_m + fit.scale * middle - bias[name] - scale[name] * middle
        assert abs(error) < 3.5 * float(fit.deviation(middle))
    out = ['-o', str(tmp_path / 'a.yaml')]
    assert main(['calibrate', 'ranges', str(folder), '--truth', str(file), *out]) == 0
    assert 'A3' in capsys.readouterr().out
    flat = tmp_path / 'flat.csv'
    flat.write_text('\n'.join(['t,x,y', *(line.rsplit(',', 1)[0] for line in lines)]))
    with BagReader(folder) as bag, pytest.raises(BagError, match='no headings'):
        range_pairs(bag, (), room.robot.tag_position, truth=read_truth(flat))
    out = ['-o', str(tmp_path / 'b.yaml')]
    assert main(['calibrate', 'ranges', str(folder), *out]) == 2
    assert 'holds no ground_truth' in capsys.readouterr().err


def test_unknown_anchor_is_named(room, tmp_path):
    """An anchor that answers and stands in no list must not be left out silently."""
    folder = tmp_path / 'bag'
    write_circle(folder, room, 1)
    known = tuple(place.anchor for place in room.anchors[:3])
    with BagReader(folder) as bag, pytest.raises(BagError, match=r'unknown anchor \(A3\)'):
        range_pairs(bag, known, room.robot.tag_position)


def test_anchor_that_was_hardly_heard_is_kept_at_zero_and_named(room):
    """The driver would lose an anchor that the file leaves out."""
    rng = np.random.default_rng(0)
    true = np.linspace(3.0, 9.0, 200)
    stamps, raw = np.arange(200), true + rng.normal(0.1, 0.05, 200)
    many, few = (
        RangePairs(place.anchor, stamps[:count], true[:count], raw[:count], 0)
        for place, count in zip(room.anchors, (200, 19), strict=False)
    )
    fits = fit_all([many, few])
    own = yaml.safe_load(parameter_text([many, few], fits))['/**/uwb_driver']['ros__parameters']
    assert own['anchor_ids'] == ['A0', 'A1']
    assert own['anchor_biases'][0] == pytest.approx(0.1, abs=0.03)
    assert (own['anchor_biases'][1], own['anchor_scales'][1]) == (0.0, 0.0)
    assert any('A1: only 19 ranges' in line for line in report([many, few], fits))
    with pytest.raises(ConfigError, match='A1: 19'):
        fit_all([few])


def test_still_tag_gives_biases_only(room, tmp_path, capsys):
    """The mean error at that distance, which is bias and scale in one; and it says so."""
    folder, file = tmp_path / 'bag', tmp_path / 'still.yaml'
    arm = room.robot.tag_position
    bias, scale, _ = write_circle(folder, room, 3, truth=False, still=(13.0, 11.0))
    place = f'{13.0 + arm[0]},{11.0 + arm[1]},{arm[2]}'
    assert main(['calibrate', 'ranges', str(folder), '--at', place, '-o', str(file)]) == 0
    assert 'only a bias can be found' in capsys.readouterr().out
    own = yaml.safe_load(file.read_text())['/**/uwb_driver']['ros__parameters']
    assert own['anchor_scales'] == [0.0] * 4
    for anchor, found in zip(room.anchors, own['anchor_biases'], strict=True):
        distance = float(np.linalg.norm(np.array(anchor.position) - (13.1, 10.95, 1.1)))
        assert found == pytest.approx(bias[anchor.id] + scale[anchor.id] * distance, abs=0.015)
    wrong = ['--at', '93,11', '-o', str(tmp_path / 'wrong.yaml')]
    assert main(['calibrate', 'ranges', str(folder), *wrong]) == 2
    assert 'anchor_biases' in capsys.readouterr().err  # no radio is that far off


def test_tag_that_did_not_stand_is_found_out(drive, tmp_path, capsys):
    """No single place explains the ranges of a drive."""
    file = str(tmp_path / 'x.yaml')
    assert main(['calibrate', 'ranges', str(drive[0]), '--at', '7,7', '-o', file]) == 2
    assert 'noise of anchor' in capsys.readouterr().err
    assert not Path(file).exists()


def test_bag_without_truth_or_ranges_is_refused(drive, restaurant, tmp_path: Path):
    anchors = tuple(place.anchor for place in restaurant.anchors)
    with BagReader(drive[0]) as whole:
        for name, topics, words in (
            ('silent', ['ground_truth'], 'neither uwb/exchanges nor uwb/ranges'),
            ('blind', ['uwb/exchanges'], 'say where'),
        ):
            folder = tmp_path / name
            with BagWriter(folder) as part:
                for topic in topics:
                    part.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
                for _, stamp, _, message in whole.messages([f'/{topics[0]}']):
                    part.write(topics[0], stamp, message)
            with BagReader(folder) as bag, pytest.raises(BagError, match=words):
                range_pairs(bag, anchors, (0.0, 0.0, 1.1))
