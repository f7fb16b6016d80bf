"""UWB-only fixes: ranges gathered into epochs, each solved for a position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.errors import GeometryError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, PoseSample, RangeSample, Refusal, nanoseconds
from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.nlos.residual_test import judge_residuals
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.registry import SOLVERS, solve

SOURCE = 'uwb/pose'

UNKNOWN_STD_M = 0.1
"""Standard deviation of a range that comes without a variance."""

SIGNIFICANCE = 0.01
"""Share of epochs with honest noise of which the covariance may be widened for nothing."""


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
    solver: str = parameter(
        'nonlinear',
        description='What turns the ranges of an epoch into a position; see docs/solvers',
        choices=tuple(SOLVERS),
        dynamic=True,
    )
    residual_test: bool = parameter(
        False,
        description='Whether each range is judged against the others before solving (5 anchors)',
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


@dataclass(frozen=True)
class FixDetail:
    """What went into the last fix.

    Attributes
    ----------
    stamp : int
        [ns].
    gdop : float
        Geometric dilution of precision of the anchors that were used.
    residuals : dict of str to float
        Range minus distance to the fix, of each anchor that answered [m].
    used : tuple of str
        Anchors whose ranges the solver used.
    """

    stamp: int
    gdop: float
    residuals: dict[str, float]
    used: tuple[str, ...]


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
        self.last: FixDetail | None = None

    def reset(self) -> None:
        """Drop the epoch that is being gathered."""
        self._epoch.clear()

    @property
    def gathered(self) -> int:
        """How many ranges of an unfinished epoch there are."""
        return len(self._epoch)

    def holds(self, anchor_id: str) -> bool:
        """Whether the unfinished epoch has a range of an anchor: another one would end it."""
        return anchor_id in self._epoch

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
        try:
            fix = self._position(epoch)
        except GeometryError:
            return Refusal(stamp, SOURCE, '', 'anchors in one line')
        if not fix.solved[0]:
            return Refusal(stamp, SOURCE, '', FixState(int(fix.state[0])).reason)
        x, y = fix.position[0]
        self.last = self._detail(stamp, epoch, fix)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = fix.covariance[0]
        if not fix.consistent(SIGNIFICANCE)[0]:
            # More scatter than the ranges' own noise explains is NLOS or bias: own up to it.
            covariance[:2, :2] *= fix.excess[0]
        covariance[2, 2] = np.inf
        return PoseSample(stamp, Pose2(float(x), float(y), 0.0), covariance, SOURCE)

    def _position(self, epoch: list[RangeSample]) -> PositionFix:
        count = len(self._anchors)
        ranges, std, nlos = np.full((1, count), np.nan), np.ones((1, count)), np.zeros((1, count))
        for item in epoch:
            column = self._order[item.anchor_id]
            ranges[0, column] = item.range_m - self._biases[item.anchor_id]
            std[0, column] = item.variance_m2**0.5 if item.variance_m2 > 0.0 else UNKNOWN_STD_M
            nlos[0, column] = item.nlos_probability
        height = self.config.tag_height
        if self.config.residual_test:
            judged = judge_residuals(Epochs.of(self._anchors, ranges, std, height, nlos))
            nlos = np.where(np.isfinite(judged.probability), judged.probability, nlos)
        known = np.where(np.isnan(nlos), 0.0, nlos)
        std = np.hypot(std, known * self.config.nlos_std)
        return solve(self.config.solver, self._anchors, ranges, std, height, nlos)

    def _detail(self, stamp: int, epoch: list[RangeSample], fix: PositionFix) -> FixDetail:
        place = np.array([*fix.position[0], self.config.tag_height])
        residuals = {
            item.anchor_id: item.range_m
            - self._biases[item.anchor_id]
            - float(np.linalg.norm(place - self._anchors[self._order[item.anchor_id]]))
            for item in epoch
        }
        used = tuple(name for name, column in self._order.items() if fix.used_mask[0, column])
        return FixDetail(stamp, float(fix.gdop[0]), residuals, used)
