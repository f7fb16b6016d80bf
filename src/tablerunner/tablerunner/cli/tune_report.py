"""What `tune` says: lines for people, figures for ``--json``, a parameter file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tablerunner.estimation.likelihood import RangeInnovations
from tablerunner.estimation.tuning import PRIOR_FACTOR, RANGE_STD, Tuned, Tuning, Verdict
from tablerunner.evaluation.consistency import Consistency, consistency
from tablerunner.evaluation.whiteness import Whiteness, lag_one


@dataclass(frozen=True)
class Judged:
    """How consistent the innovations of ranges are; the refused ones are left out."""

    accepted: float
    nis: Consistency
    whiteness: Whiteness
    log_likelihood: float  # robust, for each range, refused ones as well

    @classmethod
    def of(cls, innovations: RangeInnovations) -> Judged:
        """Judge innovations."""
        rows = innovations.accepted
        normalised = innovations.innovations[rows] / np.sqrt(innovations.variances[rows])
        return cls(
            float(np.mean(rows)),
            consistency(innovations.nis[rows].tolist(), [1] * int(np.sum(rows))),
            lag_one(normalised, innovations.anchors[rows].tolist()),
            innovations.log_likelihood / len(rows),
        )

    def figures(self) -> dict[str, Any]:
        """Return the figures."""
        return {
            'accepted': self.accepted,
            'nis': self.nis.mean,
            'nis_low': self.nis.low,
            'nis_high': self.nis.high,
            'lag_one': self.whiteness.correlation,
            'lag_one_bound': self.whiteness.bound,
            'log_likelihood': self.log_likelihood,
        }


@dataclass(frozen=True)
class TuneReport:
    """A tuning and what it was made of."""

    tuning: Tuning
    bag: Path
    estimator: str
    took_s: float

    def figures(self) -> dict[str, Any]:
        """Return what ``--json`` writes."""
        return {
            'bag': str(self.bag),
            'estimator': self.estimator,
            'ranges': len(self.tuning.before.innovations),
            'parameters': [
                {
                    'name': parameter_name(item),
                    'unit': item.unit,
                    'before': item.before,
                    'after': item.after,
                    'factor': item.factor,
                    'verdict': item.verdict.name.lower(),
                }
                for item in self.tuning.parameters
            ],
            'before': Judged.of(self.tuning.before).figures(),
            'after': Judged.of(self.tuning.after).figures(),
            'runs': self.tuning.evaluations,
            'seconds': self.took_s,
        }

    def lines(self) -> list[str]:
        """Return the lines for people."""
        tuning = self.tuning
        lines = [
            f'bag            {self.bag}: {len(tuning.before.innovations)} ranges, '
            f'{self.estimator}, {tuning.evaluations} runs in {self.took_s:.0f} s',
            f'{"parameter":<36}{"before":>9}{"after":>9}  times or by',
        ]
        for item in tuning.parameters:
            lines.append(
                f'{parameter_name(item):<36}{number(item.before):>9}{number(item.after):>9}'
                f'  {item.factor:<11.2f}  {item.verdict.value}'
            )
        lines.append(f'{"consistency":<36}{"before":>9}{"after":>9}  should be')
        before, after = Judged.of(tuning.before), Judged.of(tuning.after)
        rows = [
            ('NIS of the accepted', before.nis.mean, after.nis.mean, _between(after.nis)),
            (
                'correlation of successive ones',
                before.whiteness.correlation,
                after.whiteness.correlation,
                f'{-after.whiteness.bound:.2f} to {after.whiteness.bound:.2f}',
            ),
            (
                'log likelihood for each range',
                before.log_likelihood,
                after.log_likelihood,
                'greater',
            ),
            ('share accepted', before.accepted, after.accepted, ''),
        ]
        for name, one, other, wanted in rows:
            lines.append(f'{name:<36}{one:>9.3f}{other:>9.3f}  {wanted}'.rstrip())
        lines.append(
            f'times or by: one standard deviation, {PRIOR_FACTOR:g} when only the prior is known'
        )
        return lines

    def parameter_text(self) -> str:
        """Return a parameter file with what was tuned; what was not stands in comments."""
        own: list[str] = []
        nested: dict[str, list[str]] = {}
        driver: list[str] = []
        for item in self.tuning.parameters:
            name = parameter_name(item)
            *parts, last = name.split('.')
            head = '' if item.verdict is Verdict.TUNED else '# '
            words = f'was {number(item.before)}' if not head else item.verdict.value
            line = f'{head}{last}: {number(item.after)}  # {words}'
            if parts[0] == 'uwb_driver':
                driver.append(line)
            elif len(parts) == 1:
                own.append(line)
            else:
                nested.setdefault(parts[1], []).append(line)
        fusion = own + [
            line for title, lines in nested.items() for line in _mapping(f'{title}:', lines)
        ]
        nodes = {'fusion_node': _mapping('filter:', fusion), 'uwb_driver': driver}
        return '\n'.join(
            line
            for name, lines in nodes.items()
            if lines
            for line in _mapping(f'/**/{name}:', _mapping('ros__parameters:', lines))
        )


def _mapping(title: str, lines: list[str]) -> list[str]:
    """Return lines under a title, which is a comment when all of them are: else it were null."""
    empty = all(line.lstrip().startswith('#') for line in lines)
    return [f'{"# " if empty else ""}{title}', *(f'  {line}' for line in lines)]


def parameter_name(item: Tuned) -> str:
    """Return the name of a parameter with that of its node where it is not fusion_node's."""
    if item.name != RANGE_STD:
        return f'filter.{item.name}'
    return 'uwb_driver.range_std' if item.told else 'filter.default_range_std'


def number(value: float) -> str:
    """Return a number with three digits, never with an exponent: parameter files take no 1e-4."""
    return np.format_float_positional(float(f'{value:.3g}'), trim='0')


def _between(bounds: Consistency) -> str:
    return f'{bounds.low:.2f} to {bounds.high:.2f}'
