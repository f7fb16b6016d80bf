"""How well each anchor serves: rate, loss, blocked ranges, and what is left of its bias."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.types import LosState, RangeSample, nanoseconds, seconds
from tablerunner.uwb.positioner import FixDetail

_FEWEST = 5
"""Samples below which a share or a mean says nothing."""


@dataclass(frozen=True)
class AnchorHealthConfig(Config):
    """Over which time anchors are judged, and what is worth a warning."""

    health_window: float = parameter(
        10.0,
        unit='s',
        description='Time of measurement over which anchors are judged',
        above=0.0,
        high=600.0,
        dynamic=True,
    )
    worst_loss: float = parameter(
        0.5,
        description='Share of lost exchanges of an anchor that is a warning',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    worst_nlos: float = parameter(
        0.8,
        description='Share of NLOS ranges of an anchor that is a warning',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    worst_bias: float = parameter(
        0.3,
        unit='m',
        description='Mean residual of an anchor, either way, that is a warning',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    worst_gdop: float = parameter(
        4.0,
        description='Dilution of precision of the last fix that is a warning',
        above=0.0,
        high=1000.0,
        dynamic=True,
    )


@dataclass(frozen=True)
class AnchorHealth:
    """One anchor over the last while; NaN where there is too little to say.

    Attributes
    ----------
    rate_hz : float
        Ranges in a second.
    loss : float
        Share of exchanges that brought no range, by the tag's count of its exchanges, which goes
        round all anchors; NaN where the device does not count.
    nlos_share : float
        Share of ranges judged NLOS, of those judged.
    residual_m : float
        Mean of range minus distance to the fix: what calibration has left, or NLOS has added.
    """

    rate_hz: float
    loss: float
    nlos_share: float
    residual_m: float

    def faults(self, config: AnchorHealthConfig) -> tuple[str, ...]:
        """Return what is worth a warning, in words."""
        found = []
        if self.loss > config.worst_loss:
            found.append(f'{self.loss:.0%} of its exchanges lost')
        if self.nlos_share > config.worst_nlos:
            found.append(f'{self.nlos_share:.0%} of its ranges NLOS')
        if abs(self.residual_m) > config.worst_bias:
            found.append(f'its ranges {self.residual_m:+.2f} m off the fix')
        return tuple(found)


class AnchorWatch:
    """Keeps what the anchors brought in a window of measurement time.

    Parameters
    ----------
    config : AnchorHealthConfig
    anchor_ids : sequence of str
        Anchors that the tag goes round.
    at_once : bool
        Whether the device counts rounds of all anchors, and not exchanges.
    """

    def __init__(
        self, config: AnchorHealthConfig, anchor_ids: Sequence[str], at_once: bool = False
    ) -> None:
        self.config = config
        self._numbers_in_round = 1 if at_once else max(len(anchor_ids), 1)
        self._ranges: dict[str, deque[tuple[int, int, LosState]]] = {
            name: deque() for name in anchor_ids
        }
        self._residuals: dict[str, deque[tuple[int, float]]] = {
            name: deque() for name in anchor_ids
        }
        self._newest = 0

    def reset(self) -> None:
        """Forget everything, as after a jump back in time."""
        self._newest = 0
        for name, ranges in self._ranges.items():
            ranges.clear()
            self._residuals[name].clear()

    def add_range(self, sample: RangeSample) -> None:
        """Take a range of a known anchor; others are left out."""
        if sample.anchor_id not in self._ranges:
            return
        if sample.stamp < self._newest - nanoseconds(self.config.health_window):
            self.reset()
        self._newest = max(self._newest, sample.stamp)
        self._ranges[sample.anchor_id].append((sample.stamp, sample.sequence, sample.los))
        self._trim(sample.anchor_id)

    def add_fix(self, fix: FixDetail) -> None:
        """Take the residuals of a fix."""
        for anchor_id, residual in fix.residuals.items():
            if anchor_id in self._residuals and math.isfinite(residual):
                self._residuals[anchor_id].append((fix.stamp, residual))
                self._trim(anchor_id)

    def health(self, anchor_id: str) -> AnchorHealth:
        """Return how an anchor did over the window, up to the newest range of any anchor."""
        self._trim(anchor_id)
        ranges, residuals = self._ranges[anchor_id], self._residuals[anchor_id]
        judged = [los for _, _, los in ranges if los is not LosState.UNKNOWN]
        return AnchorHealth(
            len(ranges) / self._span_s(),
            self._loss(anchor_id),
            _mean([float(los is LosState.NLOS) for los in judged]),
            _mean([residual for _, residual in residuals]),
        )

    def _span_s(self) -> float:
        """Return the time that the window holds, at most its length [s]."""
        oldest = min((queue[0][0] for queue in self._ranges.values() if queue), default=0)
        return max(seconds(self._newest - oldest), 1.0)

    def _loss(self, anchor_id: str) -> float:
        numbers = [entry[1] for queue in self._ranges.values() for entry in queue]
        if not numbers:
            return math.nan
        expected = (max(numbers) - min(numbers) + 1) / self._numbers_in_round
        # A device that does not count sends one number; a counter that wrapped says nothing.
        if expected < _FEWEST or expected > 10 * len(numbers):
            return math.nan
        return min(max(1.0 - len(self._ranges[anchor_id]) / expected, 0.0), 1.0)

    def _trim(self, anchor_id: str) -> None:
        horizon = self._newest - nanoseconds(self.config.health_window)
        ranges, residuals = self._ranges[anchor_id], self._residuals[anchor_id]
        while ranges and ranges[0][0] < horizon:
            ranges.popleft()
        while residuals and residuals[0][0] < horizon:
            residuals.popleft()


def _mean(values: list[float]) -> float:
    return math.fsum(values) / len(values) if len(values) >= _FEWEST else math.nan
