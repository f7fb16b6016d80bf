"""UWB-only fixes: ranges gathered into epochs, each solved for a position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.errors import GeometryError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, PoseSample, RangeSample, Refusal, nanoseconds
from tablerunner.uwb.fix import FixState
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.nonlinear import solve_positions

SOURCE = 'uwb/pose'


@dataclass(frozen=True)
class PositionerConfig(Config):
    """When an epoch ends and how its fix is judged."""

    tag_height: float = parameter(
        1.1, unit='m', description='Height of the tag over the floor', low=0.0, high=10.0
    )
    epoch: float = parameter(
        0.15,
        unit='s',
        description='Longest time that one fix gathers ranges',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    nlos_std: float = parameter(
        0.5,
        unit='m',
        description='Added standard deviation of a range that is surely NLOS',
        low=0.0,
        high=20.0,
        dynamic=True,
    )


class Positioner:
    """Gathers ranges until every anchor has answered, one answers again, or time is up.

    Raises
    ------
    GeometryError
        An anchor stands twice among the anchors: its ranges would belong to two places.
    """

    def __init__(self, config: PositionerConfig, anchors: tuple[Anchor, ...]) -> None:
        self.config = config
        names = [anchor.anchor_id for anchor in anchors]
        if len(set(names)) < len(names):
            twice = sorted({name for name in names if names.count(name) > 1})
            raise GeometryError(f'anchors given twice: {", ".join(twice)}')
        self._order = {anchor.anchor_id: index for index, anchor in enumerate(anchors)}
        self._anchors = np.array([anchor.position for anchor in anchors], dtype=float)
        self._anchors = self._anchors.reshape(-1, 3)
        self._biases = {anchor.anchor_id: anchor.bias_m for anchor in anchors}
        self._epoch: dict[str, RangeSample] = {}

    def reset(self) -> None:
        """Drop the epoch that is being gathered."""
        self._epoch.clear()

    def add(self, sample: RangeSample) -> PoseSample | Refusal | None:
        """Take one range; return the fix of the epoch that it completes, if it does.

        The fix is the position of the *tag antenna*; its stamp is the mean stamp of the ranges,
        its heading is unknown (infinite variance).
        """
        if sample.anchor_id not in self._order:
            return Refusal(sample.stamp, SOURCE, sample.anchor_id, 'unknown anchor')
        finished: PoseSample | Refusal | None = None
        if self._epoch:
            first = next(iter(self._epoch.values())).stamp
            late = abs(sample.stamp - first) > nanoseconds(self.config.epoch)
            if late or sample.anchor_id in self._epoch:
                finished = self._solve()
        self._epoch[sample.anchor_id] = sample
        if len(self._epoch) == len(self._order):
            finished = self._solve()
        return finished

    def _solve(self) -> PoseSample | Refusal:
        epoch = list(self._epoch.values())
        self._epoch.clear()
        stamp = epoch[0].stamp + sum(item.stamp - epoch[0].stamp for item in epoch) // len(epoch)
        if len(epoch) < MINIMUM_RANGES:
            return Refusal(stamp, SOURCE, '', 'fewer than three ranges in an epoch')
        rows = [self._order[item.anchor_id] for item in epoch]
        ranges = np.array([[item.range_m - self._biases[item.anchor_id] for item in epoch]])
        std = np.array([[self._std(item) for item in epoch]])
        try:
            fix = solve_positions(self._anchors[rows], ranges, std, self.config.tag_height)
        except GeometryError:
            return Refusal(stamp, SOURCE, '', 'anchors in one line')
        if not fix.solved[0]:
            return Refusal(stamp, SOURCE, '', FixState(int(fix.state[0])).reason)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = fix.covariance[0]
        # More scatter than the ranges' own noise explains is NLOS or bias: own up to it.
        covariance[:2, :2] *= fix.excess[0]
        covariance[2, 2] = np.inf
        x, y = fix.position[0]
        return PoseSample(stamp, Pose2(float(x), float(y), 0.0), covariance, SOURCE)

    def _std(self, sample: RangeSample) -> float:
        probability = 0.0 if np.isnan(sample.nlos_probability) else sample.nlos_probability
        own = sample.variance_m2 if sample.variance_m2 > 0 else 0.1**2
        return float(np.sqrt(own + (probability * self.config.nlos_std) ** 2))
