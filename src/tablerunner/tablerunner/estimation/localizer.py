"""The localiser: every measurement in, the pose in the map out."""

from __future__ import annotations

import math
from dataclasses import replace

from tablerunner.errors import CovarianceError
from tablerunner.estimation.checks import check_odometry, check_pose, check_range
from tablerunner.estimation.compass import Compass
from tablerunner.estimation.estimator import RANGE_SOURCE, Estimator, Start
from tablerunner.estimation.evidence import Evidence
from tablerunner.estimation.fix_maker import FixMaker
from tablerunner.estimation.localizer_config import LocalizerConfig
from tablerunner.estimation.outcome import Outcome, refused
from tablerunner.estimation.particles.anywhere import anywhere, is_known, missing
from tablerunner.estimation.pose_start import PoseStart
from tablerunner.estimation.registry import ESTIMATORS, STARTS_ANYWHERE
from tablerunner.estimation.start_finder import StartFinder
from tablerunner.estimation.status import Cause, LocalizerState, LocalizerStatus, tracking
from tablerunner.estimation.timeline import Timeline
from tablerunner.estimation.track import OdometryTrack, plausible
from tablerunner.estimation.uwb_health import UwbHealth
from tablerunner.geometry.pose import Pose2
from tablerunner.stream import Order, StampOrder
from tablerunner.types import (
    Anchor,
    Estimate,
    Innovation,
    MagneticSample,
    OdometrySample,
    PoseSample,
    RangeSample,
    Refusal,
    nanoseconds,
)
from tablerunner.uwb.positioner import SOURCE as UWB_FIX_SOURCE

ODOMETRY_SOURCE = 'odom'


class Localizer:
    """Orders, checks and fuses measurements; finds its start; notices when it is lost.

    The same inputs in the same order give the same outputs, bit for bit; and once the start is
    known, inputs that arrive in another order (within `history`) lead to the same estimate.
    """

    def __init__(self, config: LocalizerConfig, anchors: tuple[Anchor, ...] = ()) -> None:
        self.config = config
        self._anchors: tuple[Anchor, ...] = ()
        self._anchor_ids: frozenset[str] = frozenset()
        self._fixes = FixMaker(config.positioner, (), self._lever_arm)
        self._health = UwbHealth(config.health, config.filter, (), self._lever_arm)
        self._fusing = True
        self._starts = 0
        self._compass = Compass(config.compass)
        self._clear()
        self.set_anchors(anchors)

    def _clear(self) -> None:
        self._pending = self.config.given_pose
        self._track = OdometryTrack()
        self._fixes.reset()
        self._health.begin(0)
        self._compass.reset()
        self._order = StampOrder()
        self._timeline: Timeline | None = None
        self._open = False
        self._suspect: OdometrySample | None = None
        self._lost = False
        self._evidence = Evidence()
        self._forget_start()

    def _forget_start(self) -> None:
        self._finder = StartFinder(
            self.config.alignment, self.config.filter, self._anchors, self._lever_arm
        )
        self._poses = PoseStart(self.config.alignment, self.config.filter)

    @property
    def _lever_arm(self) -> tuple[float, float, float]:
        x, y, z = self.config.tag_position
        return (x, y, z)

    # -- configuration ------------------------------------------------------------------------

    def configure(self, config: LocalizerConfig) -> None:
        """Use other dynamic settings from now on; the estimate goes on.

        Another estimator begins at the pose of the one before it.
        """
        before, self.config = self.config, config
        self._fixes.configure(config.positioner)
        self._compass.config = config.compass
        self._health.configure(config.health, config.filter)
        if self._timeline is None:
            return
        if config.estimator != before.estimator:
            self._fixes.reset()
            self._begin_again()
        else:
            self._timeline.estimator = self._new_estimator()

    def set_anchors(self, anchors: tuple[Anchor, ...]) -> None:
        """Use these anchors; other ones than before begin a new estimate at the same pose."""
        if anchors == self._anchors:
            return
        self._fixes = FixMaker(self.config.positioner, anchors, self._lever_arm)
        self._anchors = anchors
        self._health = UwbHealth(self.config.health, self.config.filter, anchors, self._lever_arm)
        self._anchor_ids = frozenset(anchor.anchor_id for anchor in anchors)
        self._forget_start()
        self._begin_again()

    def switch(self, on: bool) -> None:
        """Switch fusion on or off; while it is off, odometry alone carries the pose."""
        if on and not self._fusing and len(self._track):
            self._health.begin(self._track.newest.stamp)
        self._fusing = on

    def reset(self) -> None:
        """Forget everything but anchors, settings and switch; begin as at the start."""
        self._clear()

    def _new_estimator(self) -> Estimator:
        factory = ESTIMATORS[self.config.estimator]
        return factory(self.config.filter, self._anchors, self._lever_arm)

    # -- what is known --------------------------------------------------------------------------

    @property
    def status(self) -> LocalizerStatus:
        """State of the localiser and what to say about it."""
        if self._timeline is not None and not self._open:
            now, config = self._track.newest.stamp, self.config
            cause = self._health.cause(now)
            if not self._fusing:
                cause = Cause.SWITCHED_OFF
            elif config.estimator == 'dead_reckoning':
                cause = Cause.CHOSEN
            unfused, withheld = self._health.unfused_s(now), self._health.withholds
            return tracking(cause, unfused, config.health.silence, withheld=withheld)
        if not (self._anchors or self._poses.words):
            return LocalizerStatus(LocalizerState.WAITING, 'no anchors yet')
        if not len(self._track):
            return LocalizerStatus(LocalizerState.WAITING, 'no odometry yet')
        words = self._finder.words
        if not self._finder.count and self._poses.words:
            words = self._poses.words
        elif self._timeline is not None:
            words = missing(self._timeline.newest, self.config.alignment)
        if self._lost:
            return LocalizerStatus(LocalizerState.LOST, f'lost; {words}')
        searching = self._timeline is not None or self._finder.count or self._poses.words
        state = LocalizerState.ALIGNING if searching else LocalizerState.WAITING
        return LocalizerStatus(state, words)

    @property
    def starts(self) -> int:
        """How often an estimate began: between two numbers the pose may have jumped anywhere."""
        return self._starts

    @property
    def fusing(self) -> bool:
        """Whether measurements are taken (`switch`)."""
        return self._fusing

    @property
    def estimate(self) -> Estimate | None:
        """Newest belief of the estimator; None before its start is known."""
        return None if self._timeline is None or self._open else self._timeline.newest

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states of `estimate`; empty before its start is known."""
        return () if self._timeline is None or self._open else self._timeline.estimator.state_names

    @property
    def map_to_odom(self) -> Pose2 | None:
        """Pose of odom in map at the newest estimate; None before the start is known."""
        newest = self.estimate
        if newest is None:
            return None
        return newest.pose @ self._track.pose(newest.stamp).inverse()

    def velocity(self) -> tuple[float, float]:
        """Return forward speed [m/s] and turn rate [rad/s] of the newest odometry."""
        if not len(self._track):
            return 0.0, 0.0
        return self._track.newest.linear_m_s, self._track.newest.angular_rad_s

    # -- inputs -----------------------------------------------------------------------------------

    def add_odometry(self, sample: OdometrySample) -> Outcome:
        """Take odometry; the estimate moves on to its stamp."""
        reason = check_odometry(sample, self.config.max_speed, self.config.max_turn_rate)
        if reason:
            return refused(sample.stamp, ODOMETRY_SOURCE, '', reason)
        order = self._order.judge(sample.stamp)
        restarted: tuple[Refusal, ...] = ()
        if order is Order.RESTARTED:
            self._clear()
            self._order.judge(sample.stamp)
            restarted = (Refusal(sample.stamp, ODOMETRY_SOURCE, '', order.value),)
        reason = self._odometry_fault(sample)
        if reason:
            return refused(sample.stamp, ODOMETRY_SOURCE, '', reason)
        if self._timeline is not None:
            self._timeline.add_odometry(sample)
            self._settle()
            return Outcome(self._timeline.newest)
        self._track.add(sample)
        self._track.trim(sample.stamp - nanoseconds(self.config.alignment.window))
        if self._pending is not None:
            # Given before there was odometry: it holds for the first, whenever that may be.
            pending, self._pending = self._pending, None
            self._begin(Start.at(replace(pending, stamp=sample.stamp)))
            return Outcome(self.estimate, (), restarted)
        if self.config.estimator in STARTS_ANYWHERE and is_known(
            self.config.filter, self._anchors
        ):
            self._begin(anywhere(self.config.filter, self._anchors, sample.stamp))
        return Outcome(None, (), restarted)

    def add_range(self, sample: RangeSample) -> Outcome:
        """Take a range: correct the estimate, or help to find its start."""
        reason = self._switch_fault() or check_range(sample, self._anchor_ids)
        reason = reason or self._place_fault(sample.stamp)
        if reason:
            self._health.hear(sample, False, self._track)
            return refused(sample.stamp, RANGE_SOURCE, sample.anchor_id, reason)
        if self._timeline is not None:
            if not self._open:
                self._health.compare(sample, self._track, self._timeline)
            if self._timeline.estimator.takes_positions:
                self._health.hear(sample, None, self._track)
                return self._add_fix(sample)
            return self._correct(sample, RANGE_SOURCE, sample.anchor_id)
        alignment = self._finder.add(sample, self._track)
        if alignment is None:
            return Outcome()
        if alignment.certain:
            self._begin(self._finder.start(alignment))
            return Outcome(self.estimate)
        return Outcome(self._finder.provisional(alignment))

    def _add_fix(self, sample: RangeSample) -> Outcome:
        """Gather ranges for an estimator that takes positions; take the fix, when there is one."""
        place = self.map_to_odom
        fix = None if place is None else self._fixes.add(sample, place, self._track)
        if isinstance(fix, Refusal):
            return Outcome(None, (), (fix,))
        return Outcome() if fix is None else self.add_pose(fix)

    def add_pose(self, sample: PoseSample) -> Outcome:
        """Take a pose or a position without heading, as from a camera or a UWB-only fix.

        The place of ``uwb/pose`` is the tag's.
        """
        if sample.source == UWB_FIX_SOURCE:
            sample = replace(sample, point=self._lever_arm[:2])
        reason = self._switch_fault() or check_pose(sample) or self._place_fault(sample.stamp)
        if reason:
            self._health.hear(sample, False, self._track)
            return refused(sample.stamp, sample.source, '', reason)
        if self._timeline is None or self._open:
            found = self._start_by(sample)
            if found is not None:
                return found
        return self._correct(sample, sample.source, '')

    def _start_by(self, sample: PoseSample) -> Outcome | None:
        """Begin where a few poses agree; None: particles that began anywhere can use this one."""
        reason = self._too_early(sample.stamp)
        found = self._poses.add(sample, self._track) if not reason else None
        if isinstance(found, Start):
            self._begin(found)
            self._health.hear(sample, True, self._track)
            return Outcome(self.estimate)
        if isinstance(found, Refusal):
            if self._open:
                return None
            reason = found.reason
        return refused(sample.stamp, sample.source, '', reason) if reason else Outcome()

    def add_magnetic(self, sample: MagneticSample) -> Outcome:
        """Take a magnetic field: a heading, where it is plausible and the start is known."""
        heading = self._compass.add(sample)
        if isinstance(heading, Refusal):
            return Outcome(None, (), (heading,))
        if heading is None:
            return Outcome()
        reason = self._switch_fault() or self._place_fault(sample.stamp)
        if not reason and self._timeline is None:
            reason = 'start not known yet'
        if reason or self._timeline is None:
            return refused(sample.stamp, heading.source, '', reason)
        innovation = self._timeline.add(heading)
        if innovation is None:
            return refused(sample.stamp, heading.source, '', 'repeated')
        return self._corrected(innovation)

    def set_pose(self, sample: PoseSample) -> Outcome:
        """Begin anew at a pose that a user gives; it overrides whatever was believed."""
        reason = check_pose(sample)
        if not reason and not math.isfinite(sample.covariance[2, 2]):
            reason = 'heading missing'
        if not reason and not len(self._track):
            self._pending = sample
            return Outcome()
        reason = reason or self._place_fault(sample.stamp) or self._too_early(sample.stamp)
        if reason:
            return refused(sample.stamp, sample.source, '', reason)
        try:
            self._begin(Start.at(sample))
        except CovarianceError as error:
            return refused(sample.stamp, sample.source, '', str(error))
        return Outcome(self.estimate)

    # -- inside -----------------------------------------------------------------------------------

    def _correct(self, sample: RangeSample | PoseSample, source: str, key: str) -> Outcome:
        """Let a measurement correct the estimate, or only be judged while UWB is not trusted."""
        if self._timeline is None:
            raise RuntimeError('there is no estimate to correct')
        withhold = self._health.withholds and source in (RANGE_SOURCE, UWB_FIX_SOURCE)
        innovation = self._timeline.add(sample, withhold=withhold)
        if innovation is None:
            return refused(sample.stamp, source, key, 'repeated')
        self._watch(innovation)
        if withhold:
            innovation = innovation._replace(accepted=False, reason=Cause.DISAGREE.value)
        self._health.hear(sample, innovation.accepted, self._track)
        return self._corrected(innovation)

    def _corrected(self, innovation: Innovation) -> Outcome:
        self._settle()
        newest = None if self._timeline is None else self._timeline.newest
        return Outcome(newest, (innovation,))

    def _settle(self) -> None:
        """Believe the pose of particles that began anywhere, once it is well known."""
        if self._timeline is None or not self._open:
            return
        if not missing(self._timeline.newest, self.config.alignment):
            self._open = self._lost = False
            self._starts += 1
            self._health.begin(self._timeline.newest.stamp)
            self._evidence = Evidence()

    def _switch_fault(self) -> str:
        return '' if self._fusing else Cause.SWITCHED_OFF.value

    def _begin_again(self) -> None:
        """Begin a new estimate at the pose that is known, or search it anew."""
        estimate = self.estimate
        if estimate is None:
            self._timeline = None
        else:
            self._begin(Start(estimate.stamp, estimate.mean[:3], estimate.pose_covariance))

    def _begin(self, start: Start) -> None:
        self._timeline = Timeline(
            self._new_estimator(), self._track, start, nanoseconds(self.config.history)
        )
        self._starts += 1
        self._health.begin(start.stamp)
        self._open = start.anywhere
        self._lost = self._lost and self._open
        self._evidence = Evidence()

    def _place_fault(self, stamp: int) -> str:
        """Return why a measurement of this stamp has no place beside odometry; '' if it has."""
        if not len(self._track):
            return 'no odometry yet'
        if stamp > self._track.newest.stamp + nanoseconds(self.config.max_ahead):
            return 'ahead of odometry'
        if self._timeline is not None and not self._timeline.takes(stamp):
            return 'older than the history'
        return ''

    def _too_early(self, stamp: int) -> str:
        """Return why no estimate can begin at this stamp; '' if one can."""
        return 'older than the history' if stamp < self._track.oldest_stamp else ''

    def _odometry_fault(self, sample: OdometrySample) -> str:
        track, config = self._track, self.config
        if not len(track):
            return ''
        if track.holds(sample.stamp):
            return 'repeated'
        before = track.before(sample.stamp)
        if before is None or (
            self._timeline is not None and not self._timeline.takes(sample.stamp)
        ):
            return 'older than the history'
        if plausible(before, sample, config.max_speed, config.max_turn_rate):
            self._suspect = None
            return ''
        suspect, self._suspect = self._suspect, sample
        if suspect is None or not plausible(
            suspect, sample, config.max_speed, config.max_turn_rate
        ):
            return 'odometry jump'
        self._adopt_origin(sample)
        return 'odometry started from another origin'

    def _adopt_origin(self, sample: OdometrySample) -> None:
        """Go on from odometry that began anew elsewhere: the pose stays, the track is new."""
        estimate, self._suspect = self.estimate, None
        self._track = OdometryTrack()
        self._track.add(sample)
        self._forget_start()
        if estimate is None:
            self._timeline = None
        else:
            stamp = max(estimate.stamp, sample.stamp)
            self._begin(Start(stamp, estimate.mean[:3], estimate.pose_covariance))

    def _watch(self, innovation: Innovation) -> None:
        """Gather what speaks against the pose; when it is too much, the robot is lost."""
        if self.config.estimator == 'dead_reckoning' or not innovation.considered:
            return
        self._evidence.add(innovation, nanoseconds(self.config.lost_window))
        evidence, config = self._evidence, self.config
        if (
            evidence.mean > config.lost_nis
            or evidence.refused_for > nanoseconds(config.lost_silence)
            or evidence.doubted_for > nanoseconds(config.lost_doubt)
        ):
            self._timeline = None
            self._lost = True
            self._forget_start()
