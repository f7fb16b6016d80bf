"""uwb_driver over DDS: ranges, fixes, anchors, and what it refuses."""

from __future__ import annotations

import itertools
import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.parameter import Parameter

from tablerunner.errors import ConfigError
from tablerunner.types import UNKNOWN_YAW_VARIANCE, ExchangeSample
from tablerunner.uwb import ranging
from tablerunner_interfaces.msg import UwbAnchorArray, UwbExchange, UwbRange
from tablerunner_ros.conversions.exchange import exchange_to_message
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes
from uwb_driver.node import UwbDriver

ANCHORS = {'A0': (0.0, 0.0, 2.25), 'A1': (10.0, 0.0, 2.25), 'A2': (10.0, 8.0, 2.25)}
TAG = (4.0, 3.0, 1.1)
PARAMETERS = {
    'anchor_ids': list(ANCHORS),
    'anchor_positions': [number for place in ANCHORS.values() for number in place],
    'tag_height': TAG[2],
}
SPEED_OF_LIGHT = 299_792_458.0
TICK = 1.0 / (128.0 * 499.2e6)
REPLY = 20_000_000  # ticks, about 0.3 ms


def exchange(
    anchor: str, stamp: int, sequence: int, distance: float, **changes: Any
) -> UwbExchange:
    """Return what two perfect clocks report, started at different, wrapping counts."""
    flight = round(distance / SPEED_OF_LIGHT / TICK)
    tag, other = 2**40 - 1000, 77_000_000_000
    times = (
        tag,
        other,
        other + REPLY,
        tag + 2 * flight + REPLY,
        tag + 2 * flight + 2 * REPLY,
        other + 2 * flight + 2 * REPLY,
    )
    sample = ExchangeSample(
        stamp, anchor, 'tag', sequence, *[item % 2**40 for item in times], -80.0, -82.0
    )
    message = exchange_to_message(sample, 'uwb_tag')
    for name, value in changes.items():
        setattr(message, name, value)
    return message


class Driver:
    """A driver in this process, and the probe that talks to it."""

    def __init__(self, probe: Probe, **parameters: Any) -> None:
        self.probe = probe
        given = {**PARAMETERS, **parameters}
        self.node = probe.host(
            UwbDriver,
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        )
        self.ranges = probe.listen(UwbRange, 'uwb/ranges')
        self.fixes = probe.listen(PoseWithCovarianceStamped, 'uwb/pose')
        probe.speak(UwbExchange, 'uwb/exchanges')
        probe.connected('uwb/exchanges')
        probe.heard('uwb/ranges')
        probe.heard('uwb/pose')
        self.start = time.time_ns() - 60 * 10**9
        self.sent = 0

    def send(
        self, anchor: str, at_ms: float, distance: float | None = None, **changes: Any
    ) -> None:
        """Send an exchange of an anchor, from the tag's true place unless told otherwise."""
        self.sent += 1
        stamp = changes.pop('stamp', self.start + round(at_ms * 1e6))
        sequence = changes.pop('sequence', self.sent)
        if distance is None:
            distance = math.dist(TAG, ANCHORS.get(anchor, TAG))
        self.probe.publish('uwb/exchanges', exchange(anchor, stamp, sequence, distance, **changes))

    def refused(self, reason: str, count: int = 1) -> None:
        """Wait until a refusal is on /diagnostics."""
        self.probe.wait_diagnostic('uwb_driver: uwb/exchanges', f'refused: {reason}', str(count))


@pytest.fixture
def driver(probe: Probe) -> Driver:
    return Driver(probe)


def test_driver_exchange_becomes_a_range_of_the_true_distance(driver: Driver) -> None:
    """Through a wrap of the tag's counter; stamp, frame, names and powers go along."""
    driver.send('A1', 0.0)
    message = driver.probe.wait_for(lambda: driver.ranges, 'a range')[0]
    assert message.range == pytest.approx(math.dist(TAG, ANCHORS['A1']), abs=0.01)
    assert message.raw_range == message.range
    assert message.variance == pytest.approx(0.01)
    assert stamp_from_message(message.header.stamp) == driver.start
    assert message.header.frame_id == 'uwb_tag'
    assert (message.anchor_id, message.tag_id, message.sequence) == ('A1', 'tag', 1)
    assert (message.rx_power, message.first_path_power) == (-80.0, -82.0)
    assert message.los == UwbRange.LOS


def test_driver_calibration_is_taken_off(probe: Probe) -> None:
    """Bias and scale of each anchor (Sun 35-36); the raw range is kept beside."""
    driver = Driver(probe, anchor_biases=[0.0, 0.5, 0.0], anchor_scales=[0.0, 0.01, 0.0])
    driver.send('A1', 0.0, distance=10.6)
    message = probe.wait_for(lambda: driver.ranges, 'a range')[0]
    assert message.raw_range == pytest.approx(10.6, abs=0.01)
    assert message.range == pytest.approx(
        ranging.calibrated(message.raw_range, 0.5, 0.01), abs=1e-9
    )
    assert message.range == pytest.approx(10.0, abs=0.02)


def test_driver_anchors_reach_a_late_subscriber(driver: Driver) -> None:
    """The list is latched: who comes later gets it, once."""
    driver.probe.spin(0.2)
    late = driver.probe.listen(UwbAnchorArray, 'uwb/anchors')
    message = driver.probe.wait_for(lambda: late, 'the anchors')[0]
    assert message.header.frame_id == 'map'
    got = {
        item.anchor_id: (item.position.x, item.position.y, item.position.z)
        for item in message.anchors
    }
    assert got == ANCHORS


def test_driver_fix_is_where_the_tag_is(driver: Driver) -> None:
    """One fix for each round of the anchors; of the heading it knows nothing."""
    for index, anchor in enumerate([*ANCHORS, *ANCHORS]):
        driver.send(anchor, 25.0 * index)
    driver.probe.wait_for(lambda: len(driver.fixes) == 2, 'two fixes')
    message = driver.fixes[0]
    assert message.header.frame_id == 'map'
    assert stamp_from_message(message.header.stamp) == driver.start + 25_000_000
    place = message.pose.pose.position
    assert (place.x, place.y) == pytest.approx(TAG[:2], abs=0.05)
    covariance = message.pose.covariance.reshape(6, 6)
    assert 0.0 < covariance[0, 0] < 0.1
    assert covariance[5, 5] == pytest.approx(UNKNOWN_YAW_VARIANCE)


@pytest.mark.parametrize(
    ('send', 'reason'),
    [
        (lambda d: d.send('A0', 10.0, stamp=0), 'zero stamp (A0)'),
        (
            lambda d: d.send('A0', 0.0, stamp=time.time_ns() + 5 * 10**9),
            'stamp in the future (A0)',
        ),
        (lambda d: d.send('A0', -100.0), 'stamp does not advance (A0)'),
        (lambda d: d.send('A9', 10.0, distance=5.0), 'unknown anchor (A9)'),
        (lambda d: d.send('A0', 10.0, sequence=1), 'repeated sequence number (A0)'),
        (lambda d: d.send('A0', 10.0, poll_rx=5), 'impossible exchange times (A0)'),
        (lambda d: d.send('A0', 10.0, distance=-3.0), 'negative range (A0)'),
        (lambda d: d.send('A0', 10.0, distance=75.0), 'range beyond max_range (A0)'),
    ],
)
def test_driver_bad_exchange_is_refused_and_counted(
    driver: Driver, send: Callable[[Driver], None], reason: str
) -> None:
    """No range comes of it, the reason stands on /diagnostics, and good ones go on."""
    driver.send('A0', 0.0)
    driver.probe.wait_for(lambda: driver.ranges, 'the first range')
    send(driver)
    driver.refused(reason)
    assert len(driver.ranges) == 1
    driver.send('A0', 50.0)
    driver.probe.wait_for(lambda: len(driver.ranges) == 2, 'a range after it')


def test_driver_stream_that_begins_again_is_taken_up_and_reported(driver: Driver) -> None:
    """A bag that starts anew: three stamps in order far back, and it counts as a restart."""
    driver.send('A0', 0.0)
    driver.probe.wait_for(lambda: driver.ranges, 'the first range')
    for index in range(4):
        driver.send('A0', -20_000.0 + 100.0 * index)
    driver.probe.wait_for(lambda: len(driver.ranges) == 3, 'ranges of the new start')
    driver.refused('stamp does not advance (A0)', 2)
    driver.probe.wait_diagnostic('uwb_driver: uwb/exchanges', 'restarts', '1')


def test_driver_silent_anchor_is_an_error(probe: Probe) -> None:
    """Each anchor has a status of its own: nothing yet, then well, then silent."""
    driver = Driver(probe, silence=0.3)
    name = 'uwb_driver: uwb/exchanges/A0'

    def words() -> str:
        status = probe.diagnostic(name)
        return '' if status is None else f'{status.level[0]} {status.message}'

    probe.wait_for(lambda: words().startswith('1 nothing received yet'), 'a warning')
    driver.send('A0', 0.0)
    probe.wait_for(lambda: words().startswith('2 silent for'), 'an error')


def test_driver_without_anchors_says_so(probe: Probe) -> None:
    """Nothing can come of exchanges then; /diagnostics says what is missing."""
    Driver(probe, anchor_ids=[], anchor_positions=[])
    status = probe.wait_for(lambda: probe.diagnostic('uwb_driver'), 'the status')
    assert status.level == b'\x01'
    assert 'anchor_ids' in status.message


def test_driver_parameter_changed_while_it_runs(driver: Driver) -> None:
    """A good value works from the next range on; bad ones are refused with their reason."""
    assert driver.probe.set_parameter('uwb_driver', 'range_std', 0.2) == ''
    driver.send('A0', 0.0)
    message = driver.probe.wait_for(lambda: driver.ranges, 'a range')[0]
    assert message.variance == pytest.approx(0.04)
    assert 'range_std: got 0.0' in driver.probe.set_parameter('uwb_driver', 'range_std', 0.0)
    assert 'out of range' in driver.probe.set_parameter('uwb_driver', 'range_std', -1.0)
    assert 'read-only' in driver.probe.set_parameter('uwb_driver', 'anchor_ids', ['A0'])
    assert driver.probe.get_parameter('uwb_driver', 'range_std').double_value == 0.2


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'anchor_positions': [1.0, 2.0]}, 'anchor_positions: got (1.0, 2.0), expected 9 numbers'),
        ({'anchor_ids': ['A0', 'A0', 'A1']}, "anchor_ids[1]: got 'A0', expected each anchor once"),
        ({'range_std': 'wide'}, "range_std: got 'wide', expected a finite number above 0"),
        ({'tag_height': float('nan')}, 'tag_height: got nan, expected a finite number'),
    ],
)
def test_driver_bad_parameter_is_named(probe: Probe, changes: dict[str, Any], words: str) -> None:
    """The error names node, parameter, value and what was expected."""
    given = [Parameter(name, value=value) for name, value in {**PARAMETERS, **changes}.items()]
    with pytest.raises(ConfigError, match=re.escape(f'parameters of /uwb_driver: {words}')):
        UwbDriver(context=probe.context, parameter_overrides=given)


def test_driver_bad_parameter_file_exits_2_with_one_sentence(processes: Processes) -> None:
    """That error is all that the process says."""
    process = processes.node('uwb_driver', 'uwb_driver', {**PARAMETERS, 'range_std': 'wide'})
    assert process.wait() == 2
    assert len(process.output.splitlines()) == 1
    assert process.output.startswith(
        "parameters of /uwb_driver: range_std: got 'wide', expected a finite number above 0"
    )


def test_driver_process_works_and_ends_cleanly(probe: Probe, processes: Processes) -> None:
    """The installed executable, with whole numbers in its parameter file."""
    whole = {**PARAMETERS, 'max_range': 60, 'anchor_positions': [0, 0, 2, 10, 0, 2, 10, 8, 2]}
    process = processes.node('uwb_driver', 'uwb_driver', whole)
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    numbers = itertools.count()
    probe.repeat(
        'uwb/exchanges',
        lambda: exchange('A0', time.time_ns(), next(numbers), 5.0),
        lambda: ranges,
        'a range',
    )
    assert process.end() == 0
    assert 'Traceback' not in process.output


def test_driver_solver_and_nlos_test_are_changed_at_run_time(driver: Driver) -> None:
    """Another solver from the next epoch on; a name that is none is refused and told."""
    good = driver.node.set_parameters(
        [Parameter('solver', value='linear'), Parameter('nlos_test', value='none')]
    )
    assert all(result.successful for result in good)
    (bad,) = driver.node.set_parameters([Parameter('solver', value='magic')])
    assert not bad.successful
    assert 'nonlinear' in bad.reason
    for index, anchor in enumerate(ANCHORS):
        driver.send(anchor, 25.0 * index)
    driver.probe.wait_for(lambda: driver.fixes and len(driver.ranges) == 3, 'a fix')
    assert driver.ranges[-1].los == UwbRange.LOS_UNKNOWN
    assert driver.node._positioner.config.solver == 'linear'


@pytest.mark.parametrize('name', ['solver', 'nlos_test'])
def test_driver_unknown_choice_is_refused_at_start(probe: Probe, name: str) -> None:
    with pytest.raises(ConfigError, match=name):
        Driver(probe, **{name: 'magic'})


def test_driver_health_of_anchors_and_geometry_are_on_diagnostics(probe: Probe) -> None:
    """Rate, loss, NLOS share and residual of each anchor; a warning that names the worst."""
    driver = Driver(probe, worst_nlos=0.5)
    for index in range(40):
        for place, anchor in enumerate(ANCHORS):
            lost = anchor == 'A2' and index % 2
            blocked = {'first_path_power': -100.0} if anchor == 'A1' else {}
            if not lost:
                driver.send(
                    anchor, 100.0 * index + 25.0 * place, sequence=3 * index + place, **blocked
                )
    status = probe.wait_diagnostic(
        'uwb_driver', 'A0 rate [Hz]', lambda text: 9.5 < float(text) < 10.5
    )
    values = {item.key: item.value for item in status.values}
    assert values['A1 NLOS share'] == '1.00'
    assert float(values['A2 loss']) == pytest.approx(0.5, abs=0.05)
    assert float(values['A0 loss']) == pytest.approx(0.0, abs=0.05)
    assert float(values['A0 residual [m]']) == pytest.approx(0.0, abs=0.05)
    assert 1.0 < float(values['GDOP']) < 4.0
    assert 'A1: 100% of its ranges NLOS' in status.message
