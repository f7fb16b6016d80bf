"""What nav_controller drives by: the fuzzy controller, the ultrasonic sensors, and why."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Range

from tablerunner.geometry.pose import Pose2
from tablerunner_interfaces.msg import Stop


@pytest.fixture(scope='module')
def shared(make_running: Callable[..., Any]) -> Any:
    """Return one node for all tests here."""
    return make_running()


@pytest.fixture
def running(shared: Any) -> Any:
    """Return the node, with the robot at its start."""
    shared.begin()
    return shared


def test_fuzzy_controller_drives_unless_another_is_asked_for(running: Any) -> None:
    running.customer.send(Stop(table='table_1'))
    assert running.customer.result()[1].reached == ['table_1']
    assert running.node.get_parameter('controller').value == 'fuzzy'


def test_reasons_are_published_on_request_only(running: Any) -> None:
    """Beside its track the robot says which rules bring it back, and how strongly."""
    probe = running.probe
    heard = probe.listen(DiagnosticArray, 'fuzzy_trace')
    running.customer.send(Stop(table='table_2'))
    running.customer.wait_state('driving')
    probe.spin(0.5)
    assert heard == []
    assert probe.set_parameter('nav_controller', 'publish_trace', True) == ''
    running.robot.pose = running.robot.pose @ Pose2(0.0, 0.15)
    probe.wait_for(lambda: heard, 'reasons')
    status = heard[0].status[0]
    values = {item.key: item.value for item in status.values}
    assert status.name == 'sun_track'
    assert status.message.startswith('difference ')
    assert abs(float(values['deviation [m]'])) > 0.05
    fired = [float(value.split()[0]) for key, value in values.items() if key.startswith('rule ')]
    assert fired == sorted(fired, reverse=True)
    assert 0.0 < fired[0] <= 1.0
    assert probe.set_parameter('nav_controller', 'publish_trace', False) == ''
    running.customer.cancel()
    running.customer.result()


@pytest.mark.parametrize(
    ('distance', 'words'),
    [
        (math.nan, 'range is not a number'),
        (0.0, 'range is not positive'),
        (-1.0, 'range is not positive'),
    ],
)
def test_reading_that_is_none_is_counted_with_its_reason(
    running: Any, distance: float, words: str
) -> None:
    running.robot.ranges['front'] = distance
    running.probe.wait_diagnostic(
        'nav_controller: ultrasonic/ultrasonic_front',
        f'refused: {words}',
        lambda count: int(count) > 2,
    )


def test_nothing_echoed_is_a_reading(running: Any) -> None:
    """REP-117: inf is clear, and neither refused nor a warning."""
    running.robot.ranges['left'] = math.inf
    status = running.probe.wait_diagnostic(
        'nav_controller: ultrasonic/ultrasonic_left', 'taken', lambda count: int(count) > 2
    )
    assert not any('refused: ' in item.key for item in status.values)


def test_unknown_sensor_is_refused_by_name(running: Any) -> None:
    message = Range(range=1.0, min_range=0.03, max_range=3.0)
    message.header.frame_id = 'ultrasonic_rear'
    message.header.stamp = running.probe.node.get_clock().now().to_msg()
    running.probe.publish('ultrasonic/front', message)
    running.probe.wait_diagnostic(
        'nav_controller: ultrasonic/ultrasonic_rear', 'refused: unknown sensor', '1'
    )


def test_sensors_that_are_silent_are_told(running: Any) -> None:
    running.robot.ranges.clear()
    running.probe.wait_for(
        lambda: (
            'silent'
            in running.probe.diagnostic('nav_controller: ultrasonic/ultrasonic_front').message
        ),
        'the silence',
    )
