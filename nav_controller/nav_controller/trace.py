"""Why the fuzzy controller decided as it did, as a message."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from tablerunner.control.fuzzy import Trace
from tablerunner_ros.conversions.stamp import fill_stamp


def traces_to_message(traces: Iterable[Trace], stamp: int) -> DiagnosticArray:
    """Return decisions as a message: one status for each rule base.

    Its name is the rule base's; its message says in words what came out and by which rule mostly;
    its values are the inputs as given, each rule that fired with its strength, and the output.
    """
    message = DiagnosticArray()
    fill_stamp(message.header.stamp, stamp)
    message.status = [_status(trace) for trace in traces]
    return message


def _status(trace: Trace) -> DiagnosticStatus:
    values = {_named(item.name, item.unit): f'{item.given:.4f}' for item in trace.inputs}
    for fired in trace.fired:
        values[f'rule {fired.rule}'] = f'{fired.strength:.4f} {fired.then}'
    values[_named(trace.name, trace.unit)] = f'{trace.output:.4f}'
    words = f'{trace.name} {trace.output:.3f} {trace.unit}'.rstrip()
    if trace.fired:
        first = trace.fired[0]
        because = ', '.join(f'{name} {label}' for name, label in first.when)
        words += f': {because}: {first.then} ({100 * first.share:.0f} %)'
    return DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name=trace.base,
        message=words,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def _named(name: str, unit: str) -> str:
    return f'{name} [{unit}]' if unit else name
