"""Calibration of ranges from a bag: the biases of the simulator come out, bad input is named."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from tablerunner.bags.range_pairs import range_pairs
from tablerunner.bags.reader import BagReader
from tablerunner.cli.main import main
from tablerunner.config import Document, build
from tablerunner.errors import BagError
from tablerunner.simulation import Simulator
from tablerunner.uwb import RangerConfig
from tablerunner.uwb.range_calibration import fit_calibration


@pytest.fixture(scope='module', params=[1, 2])
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


def test_still_tag_gives_biases_only(drive, capsys, tmp_path):
    """At a place that is wrong by design: the difference of the distances is the bias."""
    folder, _, _ = drive
    with BagReader(folder) as bag:
        found = range_pairs(bag, (), (0.0, 0.0, 1.1), at=(7.0, 7.0, 1.1))
    for item in found:
        assert np.ptp(item.true) == 0.0
        assert not fit_calibration(item.true, item.raw).scale_fitted
    file = tmp_path / 'still.yaml'
    assert main(['calibrate', 'ranges', str(folder), '--at', '7,7', '-o', str(file)]) == 0
    assert 'only a bias can be found' in capsys.readouterr().out


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


def test_bag_without_truth_or_ranges_is_refused(drive, restaurant, tmp_path: Path):
    from tablerunner.bags.contract import CONTRACT
    from tablerunner.bags.writer import BagWriter

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
