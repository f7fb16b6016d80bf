"""Gathers ranges beside odometry until the start of an estimate can be believed."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.estimation.alignment import Alignment, AlignmentConfig, Window, align
from tablerunner.estimation.ekf import bias_covariance, range_variance
from tablerunner.estimation.estimator import EstimatorConfig, Start
from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.track import OdometryTrack
from tablerunner.types import Anchor, Estimate, RangeSample, nanoseconds

_MOST_RANGES = (
    240  # more are thinned out: they no longer change the answer, only the time it takes
)


class StartFinder:
    """Collects a window of ranges and tries `align` on it from time to time."""

    def __init__(
        self,
        config: AlignmentConfig,
        noise: EstimatorConfig,
        anchors: tuple[Anchor, ...],
        lever_arm: Point3,
    ) -> None:
        self.config = config
        self.words = 'no ranges yet'
        self._noise = noise
        self._anchors = {anchor.anchor_id: (i, anchor) for i, anchor in enumerate(anchors)}
        self._lever_arm = lever_arm
        self._samples: list[RangeSample] = []
        self._tried = 0
        self._reference = 0

    @property
    def count(self) -> int:
        """How many ranges have been gathered."""
        return len(self._samples)

    def add(self, sample: RangeSample, track: OdometryTrack) -> Alignment | None:
        """Take a range; return what the window says, when it is time for an attempt."""
        self._samples.append(sample)
        newest = max(sample.stamp, track.newest.stamp)
        oldest = max(newest - nanoseconds(self.config.window), track.oldest_stamp)
        self._samples = [item for item in self._samples if item.stamp >= oldest]
        due = newest - self._tried >= nanoseconds(self.config.interval)
        if len(self._samples) < self.config.min_ranges or not due:
            return None
        self._tried = newest
        self._reference = track.newest.stamp
        prior = bias_covariance(self._noise, len(self._anchors))
        alignment = align(self._window(track), prior, self.config)
        self.words = 'position still open' if alignment is None else alignment.words
        if alignment is not None and alignment.contradicted:
            # Wheels have spun, or hands have moved the robot, somewhere in this window: the newer
            # half may be free of it.
            self._samples = self._samples[len(self._samples) // 2 :]
        return alignment

    def start(self, alignment: Alignment) -> Start:
        """Return where the estimator begins, from an alignment of this finder."""
        return Start(
            self._reference,
            alignment.mean[:3],
            alignment.covariance[:3, :3],
            alignment.mean[3:],
            alignment.covariance,
        )

    def provisional(self, alignment: Alignment) -> Estimate:
        """Return the belief before the start is certain; its heading variance is honest."""
        return Estimate(self._reference, alignment.mean, alignment.covariance)

    def _window(self, track: OdometryTrack) -> Window:
        samples = self._samples
        if len(samples) > _MOST_RANGES:
            rows = np.linspace(0, len(samples) - 1, _MOST_RANGES).round().astype(int)
            samples = [samples[row] for row in rows]
        now = track.pose(self._reference)
        poses = [track.pose(sample.stamp) for sample in samples]
        xyh = np.array([(pose.x, pose.y, pose.heading) for pose in poses])
        cos, sin = np.cos(xyh[:, 2]), np.sin(xyh[:, 2])
        in_odom = xyh[:, :2] + np.stack(
            [
                cos * self._lever_arm[0] - sin * self._lever_arm[1],
                sin * self._lever_arm[0] + cos * self._lever_arm[1],
            ],
            axis=1,
        )
        found = [self._anchors[sample.anchor_id] for sample in samples]
        _, turned = self._noise.motion.variances(track.motion(samples[0].stamp, self._reference))
        return Window(
            ranges=np.array(
                [s.range_m - a.bias_m for s, (_, a) in zip(samples, found, strict=True)]
            ),
            variances=np.array([range_variance(self._noise, sample) for sample in samples]),
            anchors=np.array([anchor.position for _, anchor in found]),
            bias_index=np.array([index for index, _ in found]),
            tags=now.inverse().transform(in_odom),
            tag_height=self._lever_arm[2],
            driven=track.driven(samples[0].stamp, self._reference),
            # On average a range is half the window old: odometry has turned half as far wrong.
            turned_variance=turned / 3.0 if math.isfinite(turned) else 0.0,
        )
