"""Where a person is, from ranges between the person's tag and anchors on the robot.

Ranges come in one at a time and the robot drives between them: each is put to the place that the
person had seen from the robot at its stamp, odometry in between. docs/following.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.estimation.person_config import LEAST_ANCHORS, PersonLocatorConfig
from tablerunner.estimation.target_tracker import Target, TargetTracker, predict_ranges
from tablerunner.estimation.track import OdometryTrack
from tablerunner.stream import Order, StampOrder
from tablerunner.types import (
    OdometrySample,
    PersonSample,
    RangeSample,
    Refusal,
    Vector,
    nanoseconds,
    seconds,
)
from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.solvers.component_wise import ComponentCorrector

SOURCE = 'person/ranges'
SILENT = 'no range of the tag'
IMPLAUSIBLE = 'ranges of the tag that do not fit'
UNSOLVED = 'too few ranges of the tag for a place'

_KEPT_NS = nanoseconds(2.0)  # of odometry
_FITS = 4.0  # a first place that leaves a residual of more deviations than this is none


@dataclass(frozen=True, slots=True)
class Sight:
    """What is known of the person at an instant.

    Attributes
    ----------
    person : PersonSample or None
        None: not in sight.
    reason : str
        Why not; empty when in sight.
    """

    person: PersonSample | None
    reason: str = ''


class PersonLocator:
    """Follows one tag with the eyes; the same inputs in the same order give the same answers.

    Parameters
    ----------
    config : PersonLocatorConfig
        With at least three anchors.

    Raises
    ------
    GeometryError
        There are fewer.
    """

    def __init__(self, config: PersonLocatorConfig) -> None:
        self.config = config
        self._index = {name: number for number, name in enumerate(config.anchor_ids)}
        self._tracker = TargetTracker(config.tracker, config.anchors, config.tag_height)
        self._corrector = ComponentCorrector(config.direction_bias or (0.0, 0.0))
        self.reset()

    def reset(self) -> None:
        """Forget everything (time went back)."""
        self._order = StampOrder()
        self._links: dict[str, int] = {}  # newest stamp of each anchor
        self._track = OdometryTrack()
        self._forget()
        self._last_range = 0
        self._why = SILENT

    def _forget(self) -> None:
        self._target: Target | None = None
        self._stamp = 0  # of the target
        self._used = 0  # stamp of the last range that was used
        self._known_velocity = self.config.method == 'tracker'
        self._epoch: dict[str, RangeSample] = {}
        self._corrector.reset()

    def configure(self, config: PersonLocatorConfig) -> None:
        """Use other dynamic settings from now on; what is known of the person stays."""
        self.config = config
        self._tracker.config = config.tracker

    def add_odometry(self, sample: OdometrySample) -> Refusal | None:
        """Take the robot's own motion; return why it is refused, if it is."""
        order = self._order.judge(sample.stamp)
        if order is Order.RESTARTED:
            self.reset()
            self._order.judge(sample.stamp)
        elif order is not Order.NEWEST:
            return Refusal(sample.stamp, 'odom', '', order.value)
        self._track.add(sample)
        self._track.trim(sample.stamp - _KEPT_NS)
        return None

    def add_range(self, sample: RangeSample) -> Refusal | None:
        """Take a calibrated range between the tag and one anchor; return why it is refused."""
        reason = self._fault(sample)
        if not reason:
            self._links[sample.anchor_id] = sample.stamp
            self._last_range = max(sample.stamp, self._last_range)
            if self.config.method == 'component_wise':
                reason = self._correct(sample)
            elif self._target is None or self._is_old(sample.stamp):
                reason = self._start(sample)
            else:
                reason = self._update(self._target, sample)
        return Refusal(sample.stamp, SOURCE, sample.anchor_id, reason) if reason else None

    def sight(self, stamp: int) -> Sight:
        """Return where the person is at `stamp` [ns], seen from base_link then."""
        silent = seconds(stamp - self._used) > self.config.silence
        if self._target is None or silent:
            heard = seconds(stamp - self._last_range) <= self.config.silence
            return Sight(None, self._why if self._last_range and heard else SILENT)
        target = self._carried(self._target, max(stamp, self._stamp))
        covariance = target.covariance
        if not self._known_velocity:
            covariance = covariance.copy()
            covariance[2, 2] = covariance[3, 3] = math.inf
        x, y, along, across = (float(value) for value in target.mean)
        return Sight(PersonSample(stamp, self.config.tag_id, (x, y), (along, across), covariance))

    def _fault(self, sample: RangeSample) -> str:
        if sample.tag_id != self.config.tag_id:
            return 'another tag'
        if sample.anchor_id not in self._index:
            return 'unknown anchor'
        if sample.stamp <= 0:
            return Order.ZERO.value
        if not (math.isfinite(sample.range_m) and sample.range_m > 0.0):
            return 'range is not positive and finite'
        if sample.stamp <= self._links.get(sample.anchor_id, 0):
            return Order.LATE.value
        if not len(self._track):
            return 'no odometry yet'
        if sample.stamp < max(self._track.oldest_stamp, self._stamp):
            return 'too late'
        return ''

    def _is_old(self, stamp: int) -> bool:
        return seconds(stamp - self._used) > self.config.forget

    def _deviation(self, sample: RangeSample) -> float:
        own = math.sqrt(sample.variance_m2) if sample.variance_m2 > 0.0 else math.nan
        base = self.config.tracker.range_std if math.isnan(own) else own
        blocked = sample.nlos_probability if sample.nlos_probability > 0.0 else 0.0
        return math.hypot(base, blocked * self.config.nlos_std)

    def _carried(self, target: Target, stamp: int) -> Target:
        """Return a belief at `stamp`, seen from where base_link is then."""
        if stamp <= self._stamp or not len(self._track):
            return target
        motion = self._track.motion(self._stamp, stamp)
        if not self._known_velocity:
            # No velocity to walk on by: the place stays, the robot moves.
            target = Target(np.array([*target.mean[:2], 0.0, 0.0]), target.covariance)
        return self._tracker.predict(target, seconds(stamp - self._stamp), motion)

    def _gather(self, sample: RangeSample) -> bool:
        """Put a range to those of the epoch; return whether all that answer now have answered."""
        oldest = sample.stamp - nanoseconds(self.config.epoch)
        again = self._epoch.pop(sample.anchor_id, None) is not None
        self._epoch = {name: item for name, item in self._epoch.items() if item.stamp >= oldest}
        self._epoch[sample.anchor_id] = sample
        count = len(self._epoch)
        if count == len(self._index) or (again and count >= LEAST_ANCHORS):
            return True
        self._why = UNSOLVED
        return False

    def _epoch_arrays(self) -> tuple[Vector, Vector]:
        """Return ranges (NaN where missing) and deviations of the epoch, shape (n,) each."""
        ranges, std = np.full(len(self._index), np.nan), np.ones(len(self._index))
        for name, item in self._epoch.items():
            ranges[self._index[name]] = item.range_m
            std[self._index[name]] = self._deviation(item)
        return ranges, std

    def _start(self, sample: RangeSample) -> str:
        """Look for a first place in the epoch; return why there is none."""
        self._target = None
        if not self._gather(sample):
            return ''
        ranges, std = self._epoch_arrays()
        self._epoch.clear()
        target = self._tracker.start(ranges)
        if target is None:
            self._why = UNSOLVED
            return ''
        expected, _ = predict_ranges(target.mean, self.config.anchors, self.config.tag_height)
        if np.nanmax(np.abs(ranges - expected) / std) > _FITS:
            self._why = IMPLAUSIBLE
            return IMPLAUSIBLE
        self._target, self._stamp, self._used = target, sample.stamp, sample.stamp
        return ''

    def _update(self, target: Target, sample: RangeSample) -> str:
        """Correct the belief by one range; return why it was not used."""
        target = self._carried(target, sample.stamp)
        ranges = np.full(len(self._index), np.nan)
        ranges[self._index[sample.anchor_id]] = sample.range_m
        update = self._tracker.update(target, ranges, self._deviation(sample))
        self._target, self._stamp = update.target, sample.stamp
        if not update.used.any():
            self._why = IMPLAUSIBLE
            return IMPLAUSIBLE
        self._used = sample.stamp
        return ''

    def _correct(self, sample: RangeSample) -> str:
        """Correct a whole epoch component by component (Bae); return why there is no place."""
        if not self._gather(sample):
            return ''
        ranges, std = self._epoch_arrays()
        if self._is_old(sample.stamp):
            self._corrector.reset()
        epochs = Epochs.of(self.config.anchors, ranges, std, self.config.tag_height)
        fix = self._corrector.add(epochs)
        self._epoch.clear()
        if not np.isfinite(fix.filtered).all():
            self._why = IMPLAUSIBLE
            return IMPLAUSIBLE
        covariance = np.zeros((4, 4))
        covariance[:2, :2] = fix.covariance[0]
        self._target = Target(np.array([*fix.filtered[0], 0.0, 0.0]), covariance)
        self._stamp = self._used = sample.stamp
        return ''
