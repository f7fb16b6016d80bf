"""What a node takes, what it refuses and why, once a second on /diagnostics.

One status per stream (``NODE: uwb/ranges``) and one for the node itself (``NODE``):

- OK: nothing was refused since the last report, or only what an estimator's gate is there for;
- WARN: something was refused since the last report, time went back, or the stream has not begun;
- ERROR: everything since the last report was refused, or the stream has fallen silent.

Counters go on from the start of the node, so that a reader may come late and still see all.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from tablerunner.stream import RESTART_AFTER_S
from tablerunner.types import NANOSECONDS, Refusal, nanoseconds
from tablerunner_ros.clocks import steady_ns, steady_timer
from tablerunner_ros.qos import qos_for

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR

PERIOD_S = 1.0
"""Time between reports, of the steady clock: also while simulated time stands."""

MOST_REASONS = 40
"""Reasons that a stream keeps apart, keys included: names made of noise must not fill memory."""

LOG_EVERY_NS = 30 * NANOSECONDS
"""A refusal for the same reason is logged again after this long at the soonest."""


@dataclass
class Report:
    """One status in the making: the worst level wins, words and values add up."""

    name: str
    level: bytes = OK
    message: str = ''
    values: dict[str, str] = field(default_factory=dict)

    def add(self, level: bytes, message: str) -> None:
        """Raise the level if this one is worse; words of the worst level are kept."""
        if level > self.level or not self.message:
            self.level, self.message = max(level, self.level), message
        elif level == self.level:
            self.message = f'{self.message}; {message}'

    def to_message(self, hardware_id: str) -> DiagnosticStatus:
        """Return it as a message."""
        return DiagnosticStatus(
            level=self.level,
            name=self.name,
            message=self.message or 'ok',
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in self.values.items()],
        )


class _Stream:
    """Counters of one stream."""

    def __init__(self, silence_s: float) -> None:
        self.silence_ns = round(silence_s * NANOSECONDS)
        self.taken = 0
        self.refused = 0
        self.expected = 0  # of those refused: by a gate, as happens to good data
        self.restarts = 0
        self.reasons: Counter[str] = Counter()
        self.last_ns = 0  # steady time of the newest message that was taken
        self.stamp = 0
        self.reported_taken = 0
        self.reported_refused = 0
        self.reported_expected = 0
        self.reported_restarts = 0


class Diagnostics:
    """Counts for one node and reports every second.

    Parameters
    ----------
    node : rclpy.node.Node
        Its name stands before each status.
    hardware_id : str
        What the values are about, e.g. the tag's name; may be empty.
    restart_s : float
        A stamp that is taken although it lies this far behind the last one began a stream anew.
    """

    def __init__(
        self, node: Node, hardware_id: str = '', restart_s: float = RESTART_AFTER_S
    ) -> None:
        self._node = node
        self._hardware_id = hardware_id
        self._restart_ns = nanoseconds(restart_s)
        self._streams: dict[str, _Stream] = {}
        self._extras: list[Callable[[Report], None]] = []
        self._logged: dict[tuple[str, str], int] = {}
        self._started_ns = self._reported_ns = steady_ns()
        self._name = node.get_name()
        self._publisher = node.create_publisher(
            DiagnosticArray, 'diagnostics', qos_for('diagnostics')
        )
        steady_timer(node, PERIOD_S, self.publish)

    def watch(self, source: str, silence_s: float = 0.0) -> None:
        """Report a stream from now on; silence beyond `silence_s` is an error (0: never)."""
        self._streams[source] = _Stream(silence_s)

    def allow_silence(self, source: str, silence_s: float) -> None:
        """Let a stream that is watched be silent for another time from now on."""
        self._stream(source).silence_ns = round(silence_s * NANOSECONDS)

    def describe(self, extra: Callable[[Report], None]) -> None:
        """Call back before each report to raise the level or add values of the node's status."""
        self._extras.append(extra)

    def take(self, source: str, stamp: int = 0) -> None:
        """Count a message that was used; `stamp` [ns] is that of the measurement."""
        stream = self._stream(source)
        if stamp < stream.stamp - self._restart_ns:
            stream.restarts += 1
            self._node.get_logger().warning(f'{source}: time went back, started again')
        stream.taken += 1
        stream.last_ns = steady_ns()
        stream.stamp = stamp

    def refuse(self, refusal: Refusal, *, expected: bool = False) -> None:
        """Count a refusal by source, reason and key, and log it now and then.

        One that is `expected` (an outlier at a gate) is neither logged nor a warning by itself.
        """
        stream = self._stream(refusal.source)
        stream.refused += 1
        stream.expected += expected
        reason = f'{refusal.reason} ({refusal.key})' if refusal.key else refusal.reason
        if reason not in stream.reasons and len(stream.reasons) >= MOST_REASONS:
            reason = f'{refusal.reason} (others)' if refusal.key else 'others'
        stream.reasons[reason] += 1
        if expected:
            return
        now = steady_ns()
        mark = (refusal.source, reason)
        if now - self._logged.get(mark, -LOG_EVERY_NS) >= LOG_EVERY_NS:
            self._logged[mark] = now
            self._node.get_logger().warning(f'{refusal.source} refused: {reason}')

    def publish(self) -> None:
        """Publish the report of the time since the last one."""
        now = steady_ns()
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        own = Report(self._name)
        for extra in self._extras:
            extra(own)
        reports = [own]
        reports += [self._report(source, stream, now) for source, stream in self._streams.items()]
        message.status = [report.to_message(self._hardware_id) for report in reports]
        self._publisher.publish(message)
        self._reported_ns = now

    def _stream(self, source: str) -> _Stream:
        stream = self._streams.get(source)
        if stream is None:
            stream = self._streams[source] = _Stream(0.0)
        return stream

    def _report(self, source: str, stream: _Stream, now: int) -> Report:
        report = Report(f'{self._name}: {source}')
        taken = stream.taken - stream.reported_taken
        refused = stream.refused - stream.reported_refused
        expected = stream.expected - stream.reported_expected
        stream.reported_taken, stream.reported_refused = stream.taken, stream.refused
        stream.reported_expected = stream.expected
        elapsed_s = max((now - self._reported_ns) / NANOSECONDS, 1e-3)
        if refused:
            worst = stream.reasons.most_common(1)[0][0]
            level = ERROR if not taken else WARN if refused > expected else OK
            report.add(level, f'{refused} of {taken + refused} refused, mostly: {worst}')
        if stream.restarts > stream.reported_restarts:
            stream.reported_restarts = stream.restarts
            report.add(WARN, 'time went back: started again')
        if stream.silence_ns:
            quiet_ns = now - (stream.last_ns or self._started_ns)
            if quiet_ns > stream.silence_ns:
                level = ERROR if stream.last_ns else WARN
                words = 'silent' if stream.last_ns else 'nothing received yet'
                report.add(level, f'{words} for {quiet_ns / NANOSECONDS:.1f} s')
        report.values = {
            'taken': str(stream.taken),
            'refused': str(stream.refused),
            'rate [Hz]': f'{taken / elapsed_s:.1f}',
            'restarts': str(stream.restarts),
            'last stamp [ns]': str(stream.stamp),
        }
        for reason, count in stream.reasons.items():
            report.values[f'refused: {reason}'] = str(count)
        return report
