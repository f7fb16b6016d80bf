"""One measured figure beside what it is compared with."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Result:
    """A figure of ours, a reference measured in the same run, and their ratio."""

    name: str
    ours: float
    reference: float
    ratio: float
    unit: str
    what: str
    bound: float | None = None  # what the ratio should keep; None where nothing is promised
    at_most: bool = True

    @property
    def kept(self) -> bool:
        """Whether the ratio keeps its bound."""
        if self.bound is None:
            return True
        return self.ratio <= self.bound if self.at_most else self.ratio >= self.bound

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, for JSON."""
        return {**asdict(self), 'kept': self.kept}


def latencies(
    name: str, own: Sequence[float], passed: Sequence[float], what: str
) -> Iterator[Result]:
    """Yield median and 95 % of latencies [s] beside those of a node that only passes on."""
    for share, pick, bound in (
        ('median', statistics.median, 1.5),
        ('95 %', lambda values: sorted(values)[int(0.95 * len(values))], None),
    ):
        us, them = pick(own) * 1e3, pick(passed) * 1e3
        yield Result(f'{name}, {share}', us, them, us / them, 'ms', what, bound)
