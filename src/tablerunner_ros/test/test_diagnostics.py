"""The reporter: counts, levels, words, and its timer under a clock that stands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from tablerunner.types import Refusal
from tablerunner_ros import diagnostics
from tablerunner_ros.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.fixtures import domain, probe  # noqa: F401
from tablerunner_ros.testing.probe import Probe

SECOND = 10**9


class Sink:
    """Stands for the publisher."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def publish(self, message: Any) -> None:
        """Keep the message."""
        self.messages.append(message)


class Desk:
    """A reporter whose time and publisher are the test's."""

    def __init__(self, node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100 * SECOND
        monkeypatch.setattr(diagnostics, 'steady_ns', lambda: self.now)
        self.node = node
        self.reporter = Diagnostics(node)
        self.sink = Sink()
        self.reporter._publisher = self.sink

    def report(self, after_s: float = 1.0) -> dict[str, Any]:
        """Let time pass and report; return the statuses by name."""
        self.now += round(after_s * SECOND)
        self.reporter.publish()
        return {status.name: status for status in self.sink.messages[-1].status}


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    context = Context()
    with lease_domain() as number:
        rclpy.init(args=[], context=context, domain_id=number)
        node = Node('mine', context=context)
        yield Desk(node, monkeypatch)
        node.destroy_node()
        rclpy.shutdown(context=context)


def values(status: Any) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def test_diagnostics_all_taken_is_ok_with_rate(desk: Desk) -> None:
    """Counts and rate of what was used."""
    for index in range(40):
        desk.reporter.take('uwb/ranges', index + 1)
    status = desk.report(2.0)['mine: uwb/ranges']
    assert (status.level, status.message) == (OK, 'ok')
    assert values(status)['taken'] == '40'
    assert values(status)['rate [Hz]'] == '20.0'
    assert values(status)['last stamp [ns]'] == '40'


def test_diagnostics_some_refused_is_a_warning_with_the_commonest_reason(desk: Desk) -> None:
    """Counted by reason and key; the warning ends when it does, the counters stay."""
    desk.reporter.take('uwb/ranges', 1)
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', 'A1', 'negative range'))
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', 'A1', 'negative range'))
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', '', 'zero stamp'))
    status = desk.report()['mine: uwb/ranges']
    assert status.level == WARN
    assert status.message == '3 of 4 refused, mostly: negative range (A1)'
    assert values(status)['refused: negative range (A1)'] == '2'
    assert values(status)['refused: zero stamp'] == '1'
    desk.reporter.take('uwb/ranges', 2)
    status = desk.report()['mine: uwb/ranges']
    assert status.level == OK
    assert values(status)['refused'] == '3'
    assert values(status)['refused: negative range (A1)'] == '2'


def test_diagnostics_all_refused_is_an_error(desk: Desk) -> None:
    """Nothing of a stream can be used: somebody must look."""
    desk.reporter.refuse(Refusal(1, 'imu/data', '', 'zero stamp'))
    assert desk.report()['mine: imu/data'].level == ERROR


def test_diagnostics_outliers_at_the_gate_are_no_warning(desk: Desk) -> None:
    """That is what the gate is for; that nothing passes it is an error all the same."""
    desk.reporter.take('uwb/ranges', 1)
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', 'A1', 'beyond the gate'), expected=True)
    status = desk.report()['mine: uwb/ranges']
    assert status.level == OK
    assert values(status)['refused: beyond the gate (A1)'] == '1'
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', 'A1', 'beyond the gate'), expected=True)
    assert desk.report()['mine: uwb/ranges'].level == ERROR
    desk.reporter.take('uwb/ranges', 2)
    desk.reporter.refuse(Refusal(1, 'uwb/ranges', 'A1', 'negative range'))
    assert desk.report()['mine: uwb/ranges'].level == WARN


def test_diagnostics_watched_stream_warns_before_it_begins_and_errs_when_silent(
    desk: Desk,
) -> None:
    """Silence is judged by steady time, whatever the stamps say."""
    desk.reporter.watch('odom', 0.5)
    assert desk.report(0.4)['mine: odom'].level == OK
    status = desk.report(0.4)['mine: odom']
    assert (status.level, status.message) == (WARN, 'nothing received yet for 0.8 s')
    desk.reporter.take('odom', 1)
    assert desk.report(0.4)['mine: odom'].level == OK
    status = desk.report(0.4)['mine: odom']
    assert (status.level, status.message) == (ERROR, 'silent for 0.8 s')


def test_diagnostics_stream_may_be_allowed_another_silence(desk: Desk) -> None:
    """A tag that stands still is silent for longer; its counters go on."""
    desk.reporter.watch('uwb/device', 0.5)
    desk.reporter.take('uwb/device', 1)
    desk.reporter.allow_silence('uwb/device', 2.0)
    assert desk.report(1.9)['mine: uwb/device'].level == OK
    status = desk.report(0.2)['mine: uwb/device']
    assert (status.level, values(status)['taken']) == (ERROR, '1')


def test_diagnostics_refusals_of_a_silent_stream_are_both_told(desk: Desk) -> None:
    """Two things at one level are both in the words."""
    desk.reporter.watch('odom', 0.5)
    desk.reporter.take('odom', 1)
    desk.report()
    desk.reporter.refuse(Refusal(1, 'odom', '', 'zero stamp'))
    status = desk.report()['mine: odom']
    assert status.level == ERROR
    assert 'zero stamp' in status.message
    assert 'silent for' in status.message


def test_diagnostics_time_that_went_back_counts_as_restart(desk: Desk) -> None:
    """By more than a second; a late measurement is none."""
    desk.reporter.take('odom', 100 * SECOND)
    desk.reporter.take('odom', 100 * SECOND - SECOND // 2)
    assert values(desk.report()['mine: odom'])['restarts'] == '0'
    desk.reporter.take('odom', 50 * SECOND)
    status = desk.report()['mine: odom']
    assert status.level == WARN
    assert values(status)['restarts'] == '1'
    desk.reporter.take('odom', 51 * SECOND)
    assert desk.report()['mine: odom'].level == OK


def test_diagnostics_extra_raises_the_level_of_the_node(desk: Desk) -> None:
    """The worst level wins with its words; values are added."""

    def extra(report: Report) -> None:
        report.add(WARN, 'rather warm')
        report.add(ERROR, 'burning')
        report.add(OK, 'painted red')
        report.values['temperature [K]'] = '900'

    desk.reporter.describe(extra)
    status = desk.report()['mine']
    assert (status.level, status.message) == (ERROR, 'burning')
    assert values(status) == {'temperature [K]': '900'}


def test_diagnostics_same_refusal_is_logged_now_and_then(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stream that is refused at 100 Hz does not fill the log."""
    lines: list[str] = []

    class Logger:
        def warning(self, line: str) -> None:
            lines.append(line)

    monkeypatch.setattr(desk.node, 'get_logger', Logger)
    for _ in range(1000):
        desk.reporter.refuse(Refusal(1, 'odom', '', 'zero stamp'))
    assert lines == ['odom refused: zero stamp']
    desk.now += 31 * SECOND
    desk.reporter.refuse(Refusal(1, 'odom', '', 'zero stamp'))
    assert len(lines) == 2


def test_diagnostics_names_made_of_noise_do_not_fill_memory(desk: Desk) -> None:
    """A radio that reports garbage for anchors: the count stays whole, the list short."""
    for number in range(1000):
        desk.reporter.refuse(Refusal(1, 'uwb/ranges', f'noise{number}', 'unknown anchor'))
    got = values(desk.report()['mine: uwb/ranges'])
    assert got['refused'] == '1000'
    assert int(got['refused: unknown anchor (others)']) > 900
    assert len(got) < 60


def test_diagnostics_come_though_simulated_time_stands(probe: Probe) -> None:  # noqa: F811
    """The timer is steady: a dead simulator is reported, not waited for."""
    node = probe.host(
        lambda **options: Node('mine', **options),
        parameter_overrides=[Parameter('use_sim_time', value=True)],
    )
    reporter = Diagnostics(node)
    reporter.take('odom', 1)
    probe.wait_diagnostic('mine: odom', 'taken', '1')
