"""What `replay` says of its results: lines for people, figures for ``--json``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tablerunner.bags.replay import ReplayResult
from tablerunner.evaluation.errors import ErrorSeries, ErrorSummary
from tablerunner.types import nanoseconds, seconds


@dataclass(frozen=True)
class Replayed:
    """A replay and what was asked about it.

    Attributes
    ----------
    result : ReplayResult
    bag : Path
    took_s : float
        How long reading and replaying took.
    from_s : float
        Seconds after the first measurement from which on errors are given once more.
    smoothed : ErrorSeries or None
        Errors of the smoothed path, where that was asked for.
    """

    result: ReplayResult
    bag: Path
    took_s: float
    from_s: float = 0.0
    smoothed: ErrorSeries | None = None

    @property
    def initialised_after(self) -> float | None:
        """Seconds from the first measurement to the start; None: it was never found."""
        if self.result.initialised is None:
            return None
        return seconds(self.result.initialised - self.result.first_stamp)

    def late(self, errors: ErrorSeries) -> ErrorSummary:
        """Return the size of the errors from `from_s` on."""
        return errors.since(self.result.first_stamp + nanoseconds(self.from_s)).summary()

    def figures(self) -> dict[str, Any]:
        """Return what ``--json`` writes; lengths in m, times in s."""
        result = self.result
        sources = result.by_source()
        content = {
            'bag': str(self.bag),
            'estimator': result.estimator,
            'state': result.state.value,
            'initialised_after': self.initialised_after,
            **self._errors(result.errors),
            'accepted': {name: item.accepted for name, item in sources.items()},
            'nis': {name: item.nis.mean for name, item in sources.items()},
            'measurements': {name: item.count for name, item in sources.items()},
            'refused': {
                f'{source}: {reason}': count for (source, reason), count in result.refusals.items()
            },
            'damage': [str(item) for item in result.damage],
            'data_seconds': result.data_s,
            'seconds': self.took_s,
        }
        if self.smoothed is not None:
            content['smoothed'] = self._errors(self.smoothed)
        return content

    def _errors(self, errors: ErrorSeries) -> dict[str, Any]:
        summary, late = errors.summary(), self.late(errors)
        return {
            'rmse': summary.rmse,
            'mean': summary.mean,
            'max': summary.max,
            'final': summary.final,
            'heading_rmse': summary.heading_rmse,
            'compared': summary.count,
            'from_seconds': self.from_s,
            'rmse_from': late.rmse,
            'mean_from': late.mean,
            'max_from': late.max,
        }

    def lines(self) -> list[str]:
        """Return the lines for people."""
        result, after = self.result, self.initialised_after
        inputs = [topic for topic in result.sources if topic != 'ground_truth']
        words = 'never initialised' if after is None else f'initialised after {after:.1f} s'
        lines = [
            f'bag            {self.bag}: {result.data_s:.1f} s of ' + ', '.join(inputs),
            f'estimator      {result.estimator}, {words}, {result.state.value} at the end',
            *self._error_lines('position error', result.errors),
        ]
        if self.smoothed is not None:
            lines += self._error_lines('smoothed      ', self.smoothed)
        for source, item in result.by_source().items():
            lines.append(
                f'{source:<14} {100 * item.accepted:.1f} % of {item.count} accepted, '
                f'mean NIS {item.nis.mean:.2f}'
            )
        for (source, reason), count in result.refusals.items():
            lines.append(f'{source:<14} {count} refused: {reason}')
        speed = result.data_s / self.took_s
        lines.append(f'took           {self.took_s:.2f} s, {speed:.0f} times real time')
        return lines

    def _error_lines(self, title: str, errors: ErrorSeries) -> list[str]:
        summary, late = errors.summary(), self.late(errors)
        if not summary.count:
            return [f'{title} unknown: no truth at the times of the estimates']
        lines = [
            f'{title} rmse {summary.rmse:.3f} m, mean {summary.mean:.3f} m, '
            f'max {summary.max:.3f} m, final {summary.final:.3f} m'
        ]
        if self.from_s > 0.0:
            words = f'from {self.from_s:g} s on'
            lines.append(
                f'{words:<14} rmse {late.rmse:.3f} m, mean {late.mean:.3f} m, max {late.max:.3f} m'
                if late.count
                else f'{words:<14} no truth'
            )
        return lines


def table(items: list[Replayed]) -> list[str]:
    """Return a table of several replays of one bag, lengths in m."""
    first = items[0]
    inputs = [topic for topic in first.result.sources if topic != 'ground_truth']
    late = f'from {first.from_s:g} s'
    heads = ['start', 'rmse', 'mean', 'max', 'final', late, 'NIS', 'accepted']
    lines = [
        f'bag            {first.bag}: {first.result.data_s:.1f} s of ' + ', '.join(inputs),
        'position error [m]; start: when it was found [s]; '
        f'{late}: rmse from there on; NIS of the accepted',
        f'{"estimator":<19}' + ''.join(f'{head:>10}' for head in heads),
    ]
    for item in items:
        after = item.initialised_after
        sources = [summary for summary in item.result.by_source().values() if summary.count]
        used = sum(summary.count for summary in sources)
        accepted = sum(summary.count * summary.accepted for summary in sources)
        dimensions = sum(summary.nis.dimensions for summary in sources)
        nis = sum(s.nis.mean * s.nis.dimensions for s in sources if s.nis.dimensions)
        cells = [
            'never' if after is None else f'{after:.1f}',
            *_cells(item, item.result.errors),
            f'{nis / dimensions:.2f}' if dimensions else '-',
            f'{100 * accepted / used:.1f} %' if used else '-',
        ]
        lines.append(f'{item.result.estimator:<19}' + ''.join(f'{cell:>10}' for cell in cells))
        if item.smoothed is not None:
            cells = ['-', *_cells(item, item.smoothed), '-', '-']
            name = f'{item.result.estimator} smoothed'
            lines.append(f'{name:<19}' + ''.join(f'{cell:>10}' for cell in cells))
    return lines


def _cells(item: Replayed, errors: ErrorSeries) -> list[str]:
    summary, late = errors.summary(), item.late(errors)
    if not summary.count:
        return ['-'] * 5
    values = (summary.rmse, summary.mean, summary.max, summary.final)
    return [*(f'{value:.3f}' for value in values), f'{late.rmse:.3f}' if late.count else '-']
