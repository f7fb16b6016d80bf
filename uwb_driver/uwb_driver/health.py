"""How well the anchors serve, as values and warnings of the node's status."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tablerunner.types import RangeSample
from tablerunner.uwb import AnchorWatch
from tablerunner.uwb.positioner import FixDetail
from tablerunner_ros.diagnostics import WARN, Report


def describe_anchors(
    report: Report,
    watch: AnchorWatch,
    last: Mapping[str, RangeSample],
    fix: FixDetail | None,
) -> None:
    """Add every anchor's health, and the geometry of the last fix, to a report.

    Parameters
    ----------
    report : Report
        The node's status.
    watch : AnchorWatch
        What the anchors brought over the last while.
    last : mapping of str to RangeSample
        Newest range of each anchor that ever answered.
    fix : FixDetail or None
        The last fix.
    """
    for anchor_id, sample in last.items():
        health = watch.health(anchor_id)
        values = {
            'range [m]': (sample.range_m, '.3f'),
            'NLOS probability': (sample.nlos_probability, '.2f'),
            'rate [Hz]': (health.rate_hz, '.1f'),
            'loss': (health.loss, '.2f'),
            'NLOS share': (health.nlos_share, '.2f'),
            'residual [m]': (health.residual_m, '+.3f'),
        }
        for name, (value, spec) in values.items():
            known = math.isfinite(value)
            report.values[f'{anchor_id} {name}'] = format(value, spec) if known else 'unknown'
        for fault in health.faults(watch.config):
            report.add(WARN, f'{anchor_id}: {fault}')
    if fix is None:
        return
    report.values['GDOP'] = f'{fix.gdop:.2f}'
    report.values['anchors in the last fix'] = ' '.join(fix.used)
    if fix.gdop > watch.config.worst_gdop:
        report.add(WARN, f'poor geometry: GDOP {fix.gdop:.1f}')
