"""Replay of a bag through the code that the nodes run: same bag, same result, bit for bit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.bags.storage import Damage
from tablerunner.bags.streams import bag_records, converters, full_name
from tablerunner.errors import BagError
from tablerunner.estimation import Localizer, LocalizerState, Outcome
from tablerunner.estimation.recording import RecordingLocalizer, Run
from tablerunner.evaluation.consistency import SourceSummary, summarize_innovations
from tablerunner.evaluation.errors import ErrorSeries, compare
from tablerunner.evaluation.truth import Stamps, Truth
from tablerunner.messages.imu import MAGNETIC_SOURCE
from tablerunner.messages.truth import TruePose
from tablerunner.odometry import Odometer
from tablerunner.types import (
    Anchor,
    Estimate,
    ExchangeSample,
    ImuSample,
    Innovation,
    MagneticSample,
    Matrix,
    OdometrySample,
    PoseSample,
    RangeSample,
    Refusal,
    WheelSample,
    nanoseconds,
    seconds,
)
from tablerunner.uwb import Positioner, Ranger

FUTURE = 'stamp in the future'
TRUTH = 'ground_truth'


@dataclass(frozen=True)
class Estimates:
    """What the estimator believed over time; one row for each time it changed its mind.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Times of the estimates [ns], in the order in which they came out.
    poses : ndarray, shape (n, 3)
        x, y [m], heading [rad] of base_link in map.
    covariances : ndarray, shape (n, 3, 3)
        Of the poses.
    trusted : ndarray of bool, shape (n,)
        Whether the estimator had declared itself initialised.
    """

    stamps: Stamps
    poses: Matrix
    covariances: Matrix
    trusted: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    def settled(self) -> Estimates:
        """Return the trusted ones, of several for one time only the last."""
        rows = np.flatnonzero(self.trusted)
        stamps, first = np.unique(self.stamps[rows][::-1], return_index=True)
        chosen = rows[::-1][first]
        return Estimates(
            stamps, self.poses[chosen], self.covariances[chosen], self.trusted[chosen]
        )


@dataclass(frozen=True)
class ReplayResult:
    """What came out of a replay.

    Attributes
    ----------
    estimator : str
        Name of the estimator.
    sources : tuple of str
        Topics that were used.
    anchors : tuple of Anchor
        Anchors that were used.
    estimates : Estimates
        All that the estimator said.
    state : LocalizerState
        In which state it ended.
    initialised : int or None
        Stamp at which it first declared itself initialised [ns].
    innovations : tuple of Innovation
        What each measurement did.
    refusals : dict of (source, reason) to int
        Measurements that did not reach the estimator, and why.
    truth : Truth
        From ground_truth; empty when the bag has none.
    errors : ErrorSeries
        Of the settled estimates against the truth.
    ranges : tuple of RangeSample
        All ranges, calibrated.
    fixes : tuple of PoseSample
        UWB-only fixes; empty unless asked for.
    first_stamp : int
        Stamp of the first measurement [ns].
    start, end : int
        Times of reception of the first and last message of the bag [ns].
    damage : tuple of Damage
        What of the bag could not be read.
    runs : tuple of Run
        Every step of the estimator; empty unless asked for.
    """

    estimator: str
    sources: tuple[str, ...]
    anchors: tuple[Anchor, ...]
    estimates: Estimates
    state: LocalizerState
    initialised: int | None
    innovations: tuple[Innovation, ...]
    refusals: dict[tuple[str, str], int]
    truth: Truth
    errors: ErrorSeries
    ranges: tuple[RangeSample, ...]
    fixes: tuple[PoseSample, ...]
    first_stamp: int
    start: int
    end: int
    damage: tuple[Damage, ...] = ()
    runs: tuple[Run, ...] = ()

    @property
    def data_s(self) -> float:
        """Length of the bag [s]."""
        return seconds(self.end - self.start)

    def by_source(self) -> dict[str, SourceSummary]:
        """Return acceptance and NIS of each source."""
        return summarize_innovations(self.innovations)


def replay(bag: BagReader, config: ReplayConfig) -> ReplayResult:
    """Run a bag through odometry, ranging and estimation.

    Messages are taken in their order of reception, so that late ones are late here too. The
    rawest topics present are used: joint_states and imu/data, else odom; uwb/exchanges, else
    uwb/ranges. Anchors are those of `config`, else those of uwb/anchors. Poses of camera/pose and
    initialpose are used as fusion_node does.

    Parameters
    ----------
    bag : BagReader
        The bag.
    config : ReplayConfig
        Settings of the nodes that are replayed.

    Raises
    ------
    BagError
        The bag holds no odometry, or no anchors are known.
    """
    run = _Replay(bag, config)
    for topic, received, record in bag_records(
        bag,
        run.topics,
        config.namespace,
        converters(config.names),
    ):
        run.take(topic, received, record)
    return run.result()


@dataclass
class _Log:
    """What is gathered on the way; arrays are made once, at the end."""

    stamps: list[int] = field(default_factory=list)
    means: list[Matrix] = field(default_factory=list)
    covariances: list[Matrix] = field(default_factory=list)
    trusted: list[bool] = field(default_factory=list)
    innovations: list[Innovation] = field(default_factory=list)
    refusals: Counter[tuple[str, str]] = field(default_factory=Counter)
    truth: list[TruePose] = field(default_factory=list)
    ranges: list[RangeSample] = field(default_factory=list)
    fixes: list[PoseSample] = field(default_factory=list)


class _Replay:
    """The three nodes in one process: odom_node, uwb_driver and fusion_node."""

    def __init__(self, bag: BagReader, config: ReplayConfig) -> None:
        self._bag, self._config = bag, config
        self._tolerance = nanoseconds(config.stamp_tolerance)
        self._log = _Log()
        self.topics = self._choose()
        self._own_anchors = bool(config.ranger.anchor_ids)
        if not self._own_anchors:
            self._take_bag_anchors()
        anchors = self._config.ranger.anchors
        self._odometer = Odometer(self._config.odometer)
        self._ranger = Ranger(self._config.ranger)
        self._positioner = Positioner(self._config.positioner, anchors)
        localizer = RecordingLocalizer if config.keep else Localizer
        self._localizer = localizer(self._config.localizer)
        self._localizer.set_anchors(anchors)
        self._initialised: int | None = None
        self._first_stamp = 0
        self._handlers: dict[str, Callable[[Any], None]] = {
            'joint_states': self._take_wheels,
            'imu/data': self._take_imu,
            'odom': self._take_odometry,
            'uwb/exchanges': self._take_exchange,
            'uwb/ranges': self._take_range,
            'camera/pose': self._take_pose,
            MAGNETIC_SOURCE: self._take_magnetic,
            'initialpose': self._take_initial_pose,
        }

    def _choose(self) -> tuple[str, ...]:
        def present(topic: str) -> bool:
            found = self._bag.topic(full_name(topic, self._config.namespace))
            return found is not None and found.count > 0

        wheels, ranges = 'joint_states', 'uwb/exchanges'
        topics = [wheels, 'imu/data'] if present(wheels) else ['odom']
        if not present(topics[0]):
            place = f' in namespace {self._config.namespace}' if self._config.namespace else ''
            raise BagError(
                f'{self._bag.path} holds neither joint_states nor odom{place}: there is nothing '
                'to replay'
            )
        topics.append(ranges if present(ranges) else 'uwb/ranges')
        if self._config.localizer.compass.use:
            topics.append(MAGNETIC_SOURCE)
        topics += ['camera/pose', 'initialpose', TRUTH]
        return tuple(topic for topic in topics if present(topic))

    def _take_bag_anchors(self) -> None:
        """Use the anchors that the driver announced when the bag was recorded."""
        table = converters(self._config.names)
        for item in bag_records(self._bag, ['uwb/anchors'], self._config.namespace, table):
            if isinstance(item.record, tuple) and item.record:
                self._config = self._config.with_anchors(item.record)
                return
        if any(topic.startswith('uwb/') for topic in self.topics):
            raise BagError(
                f'{self._bag.path} does not say where the anchors are (no uwb/anchors): give a '
                'scenario file'
            )

    def take(self, topic: str, received: int, record: Any) -> None:
        """Take one message as the node that subscribes to its topic would."""
        if isinstance(record, Refusal):
            self._refuse(record)
        elif topic == TRUTH:
            self._log.truth.append(record)
        elif record.stamp > received + self._tolerance:
            self._log.refusals[topic, FUTURE] += 1
        else:
            if not self._first_stamp:
                self._first_stamp = record.stamp
            self._handlers[topic](record)

    def _refuse(self, refusal: Refusal) -> None:
        self._log.refusals[refusal.source, refusal.reason] += 1

    def _take_wheels(self, sample: WheelSample) -> None:
        odometry = self._odometer.add_wheels(sample)
        if isinstance(odometry, Refusal):
            self._refuse(odometry)
        else:
            self._note(self._localizer.add_odometry(odometry))

    def _take_imu(self, sample: ImuSample) -> None:
        refusal = self._odometer.add_imu(sample)
        if refusal is not None:
            self._refuse(refusal)

    def _take_odometry(self, sample: OdometrySample) -> None:
        self._note(self._localizer.add_odometry(sample))

    def _take_exchange(self, sample: ExchangeSample) -> None:
        ranged = self._ranger.add(sample)
        if isinstance(ranged, Refusal):
            self._refuse(ranged)
        else:
            self._take_range(ranged)

    def _take_pose(self, sample: PoseSample) -> None:
        self._note(self._localizer.add_pose(sample))

    def _take_magnetic(self, sample: MagneticSample) -> None:
        self._note(self._localizer.add_magnetic(sample))

    def _take_initial_pose(self, sample: PoseSample) -> None:
        self._note(self._localizer.set_pose(sample))

    def _take_range(self, sample: RangeSample) -> None:
        self._log.ranges.append(sample)
        if self._config.fixes:
            fix = self._positioner.add(sample)
            if isinstance(fix, PoseSample):
                self._log.fixes.append(fix)
            elif isinstance(fix, Refusal):
                self._refuse(fix)
        self._note(self._localizer.add_range(sample))

    def _note(self, outcome: Outcome) -> None:
        log = self._log
        for refusal in outcome.refusals:
            self._refuse(refusal)
        log.innovations.extend(outcome.innovations)
        estimate: Estimate | None = outcome.estimate
        if estimate is None:
            return
        trusted = self._localizer.estimate is not None
        if trusted and self._initialised is None:
            self._initialised = estimate.stamp
        log.stamps.append(estimate.stamp)
        log.means.append(estimate.mean[:3])
        log.covariances.append(estimate.covariance[:3, :3])
        log.trusted.append(trusted)

    def result(self) -> ReplayResult:
        """Return what was gathered."""
        log, count = self._log, len(self._log.stamps)
        estimates = Estimates(
            np.array(log.stamps, dtype=np.int64),
            np.array(log.means).reshape(count, 3),
            np.array(log.covariances).reshape(count, 3, 3),
            np.array(log.trusted, dtype=bool),
        )
        truth = Truth.from_poses(log.truth)
        settled = estimates.settled()
        return ReplayResult(
            self._config.localizer.estimator,
            self.topics,
            self._config.ranger.anchors,
            estimates,
            self._localizer.status.state,
            self._initialised,
            tuple(log.innovations),
            dict(sorted(log.refusals.items())),
            truth,
            compare(settled.stamps, settled.poses, truth, settled.covariances),
            tuple(log.ranges),
            tuple(log.fixes),
            self._first_stamp,
            self._bag.start,
            self._bag.end,
            self._bag.damage,
            self._localizer.runs() if isinstance(self._localizer, RecordingLocalizer) else (),
        )
