"""The start from poses, as of a ceiling camera: believed when a few in a row agree.

The first pose with a heading begins a small filter on poses and odometry alone; each that follows
is compared with where odometry has led it. One that the filter would refuse begins anew, so that
one false marker starts nothing, nor one that stands still while the robot drives.
"""

from __future__ import annotations

import math

from tablerunner.estimation.alignment import AlignmentConfig
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.particles.anywhere import missing
from tablerunner.estimation.track import OdometryTrack
from tablerunner.types import Estimate, PoseSample, Refusal, nanoseconds

POSES_NEEDED = 3
"""Poses in a row that must agree with each other and with odometry."""

LONGEST_GAP_S = 2.0
"""Time between two of them beyond which the older ones no longer count."""

NO_HEADING = 'start not known yet: the pose has no heading'
OVERTAKEN = 'overtaken by a newer pose'


class PoseStart:
    """Follows poses beside odometry until the start of an estimate can be believed.

    Parameters
    ----------
    config : AlignmentConfig
        How well place and heading must be known.
    noise : EstimatorConfig
        Noise of odometry, and the gate of poses: chi-square of three numbers.
    """

    def __init__(self, config: AlignmentConfig, noise: EstimatorConfig) -> None:
        self.words = ''
        """What is still missing, for people; empty before the first pose."""
        self._config = config
        self._filter = Ekf(noise, (), (0.0, 0.0, 0.0))
        self._estimate: Estimate | None = None
        self._count = 0

    def add(self, sample: PoseSample, track: OdometryTrack) -> Start | Refusal | None:
        """Take a pose that `check_pose` has passed; return the start once it is believed.

        Parameters
        ----------
        sample : PoseSample
            Not before the oldest odometry.
        track : OdometryTrack
            What the robot has driven.

        Returns
        -------
        Start, Refusal or None
            Where the robot is; why this pose is of no use; None: it counts, more are needed.
        """
        estimate = self._estimate
        if estimate is not None and estimate.stamp >= sample.stamp:
            if estimate.stamp - sample.stamp < nanoseconds(LONGEST_GAP_S):
                return Refusal(sample.stamp, sample.source, '', OVERTAKEN)
            estimate = None  # time has begun anew
        if estimate is not None:
            oldest = max(sample.stamp - nanoseconds(LONGEST_GAP_S), track.oldest_stamp)
            estimate = (
                self._followed(estimate, sample, track) if estimate.stamp >= oldest else None
            )
        if estimate is None:
            return self._begin(sample)
        self._estimate = estimate
        self._count += 1
        self.words = missing(estimate, self._config)
        if self._count < POSES_NEEDED:
            self.words = self._counted()
        if self.words:
            return None
        return Start(estimate.stamp, estimate.mean[:3], estimate.pose_covariance)

    def _begin(self, sample: PoseSample) -> Refusal | None:
        self._estimate, self._count = None, 0
        if not math.isfinite(sample.covariance[2, 2]) or sample.point != (0.0, 0.0):
            self.words = 'heading unknown: drive'
            return Refusal(sample.stamp, sample.source, '', NO_HEADING)
        self._estimate, self._count = self._filter.start(Start.at(sample)), 1
        self.words = self._counted()
        return None

    def _counted(self) -> str:
        return f'{self._count} of {POSES_NEEDED} poses that agree'

    def _followed(
        self, estimate: Estimate, sample: PoseSample, track: OdometryTrack
    ) -> Estimate | None:
        """Return the estimate led on by odometry and corrected; None where both disagree."""
        between = [stamp for stamp in track.stamps_after(estimate.stamp) if stamp < sample.stamp]
        for stamp in (*between, sample.stamp):
            motion = track.motion(estimate.stamp, stamp)
            estimate = self._filter.predict(estimate, motion, stamp)
        after, innovation = self._filter.update(estimate, sample)
        return after if innovation.accepted else None
