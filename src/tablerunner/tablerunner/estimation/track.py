"""The odometry of the last while as a curve: how far and which way between any two instants."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right, insort
from itertools import pairwise

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance, between_poses
from tablerunner.types import OdometrySample, seconds


class OdometryTrack:
    """Arc length and heading over time, piecewise linear between odometry samples.

    Beyond the newest sample its velocity is held. Samples may come late; what they change is
    worked out again as if they had come in order.
    """

    def __init__(self) -> None:
        self._samples: list[OdometrySample] = []
        self._stamps: list[int] = []
        self._lengths: list[float] = []  # [m], signed, from the oldest sample ever
        self._headings: list[float] = []  # [rad], not wrapped
        self._spreads: list[float] = []  # [m^2], variance of the length as odometry tells it

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def newest(self) -> OdometrySample:
        """The newest sample."""
        return self._samples[-1]

    @property
    def oldest_stamp(self) -> int:
        """Stamp of the oldest sample that is kept."""
        return self._stamps[0]

    def before(self, stamp: int) -> OdometrySample | None:
        """Return the newest sample not after `stamp`, if any is kept."""
        index = bisect_right(self._stamps, stamp) - 1
        return None if index < 0 else self._samples[index]

    def stamps_after(self, stamp: int) -> list[int]:
        """Return the stamps of all samples later than `stamp`, in order."""
        return self._stamps[bisect_right(self._stamps, stamp) :]

    def holds(self, stamp: int) -> bool:
        """Whether there is a sample of exactly this stamp."""
        index = bisect_left(self._stamps, stamp)
        return index < len(self._stamps) and self._stamps[index] == stamp

    def add(self, sample: OdometrySample) -> None:
        """Put a sample in its place."""
        if not self._stamps:
            self._lengths.append(0.0)
            self._headings.append(sample.pose.heading)
            self._spreads.append(0.0)
        insort(self._samples, sample, key=_stamp)
        insort(self._stamps, sample.stamp)
        first = bisect_left(self._stamps, sample.stamp)
        if first == 0 and len(self._stamps) > 1:
            raise ValueError('a sample older than the whole track has no place in it')
        for values in (self._lengths, self._headings, self._spreads):
            del values[max(first, 1) :]
        for index in range(max(first, 1), len(self._stamps)):
            start, end = self._samples[index - 1], self._samples[index]
            step = between_poses(start.pose, end.pose, 0.0)
            self._lengths.append(self._lengths[-1] + step.distance_m)
            self._headings.append(self._headings[-1] + step.turn_rad)
            told = _told_variance(end, seconds(end.stamp - start.stamp))
            self._spreads.append(self._spreads[-1] + told)

    def trim(self, stamp: int) -> None:
        """Drop what is not needed for instants from `stamp` on."""
        drop = bisect_right(self._stamps, stamp) - 1
        if drop > 0:
            for values in (
                self._samples,
                self._stamps,
                self._lengths,
                self._headings,
                self._spreads,
            ):
                del values[:drop]

    def motion(self, start: int, end: int) -> Motion:
        """Return the motion between two instants [ns], both in or after the track."""
        length_a, heading_a, spread_a = self._at(start)
        length_b, heading_b, spread_b = self._at(end)
        return Motion(
            length_b - length_a,
            heading_b - heading_a,
            seconds(end - start),
            max(spread_b - spread_a, 0.0),
        )

    def driven(self, start: int, end: int) -> float:
        """Return the length of the way between two instants [m], forward and backward alike."""
        first, last = bisect_left(self._stamps, start), bisect_right(self._stamps, end)
        lengths = self._lengths[first:last]
        return sum(abs(after - before) for before, after in pairwise(lengths))

    def pose(self, stamp: int) -> Pose2:
        """Return the pose of base_link in odom at an instant."""
        index = max(bisect_right(self._stamps, stamp) - 1, 0)
        sample = self._samples[index]
        if sample.stamp == stamp:
            return sample.pose
        return advance(sample.pose, self.motion(sample.stamp, stamp))

    def _at(self, stamp: int) -> tuple[float, float, float]:
        stamps = self._stamps
        index = bisect_right(stamps, stamp) - 1
        if index == len(stamps) - 1:
            sample = self._samples[-1]
            ahead = seconds(stamp - sample.stamp)
            return (
                self._lengths[-1] + sample.linear_m_s * ahead,
                self._headings[-1] + sample.angular_rad_s * ahead,
                self._spreads[-1] + _told_variance(sample, ahead),
            )
        index = max(index, 0)
        share = (stamp - stamps[index]) / (stamps[index + 1] - stamps[index])
        length, heading = self._lengths[index], self._headings[index]
        spread = self._spreads[index]
        return (
            length + share * (self._lengths[index + 1] - length),
            heading + share * (self._headings[index + 1] - heading),
            spread + share * (self._spreads[index + 1] - spread),
        )


def _told_variance(sample: OdometrySample, dt_s: float) -> float:
    """Return what odometry says of the distance of a step that ends with a sample [m^2]."""
    variance = float(sample.twist_covariance[0, 0])
    return variance * dt_s * dt_s if math.isfinite(variance) and variance > 0.0 else 0.0


def plausible(start: OdometrySample, end: OdometrySample, speed: float, turn_rate: float) -> bool:
    """Whether a robot limited to `speed` [m/s] and `turn_rate` [rad/s] can do this step.

    A slack of 0.1 m and 0.2 rad forgives jitter of stamps.
    """
    dt = abs(seconds(end.stamp - start.stamp))
    distance = math.hypot(end.pose.x - start.pose.x, end.pose.y - start.pose.y)
    turn = abs(wrap(end.pose.heading - start.pose.heading))
    return distance <= speed * dt + 0.1 and turn <= min(turn_rate * dt + 0.2, math.pi)


def _stamp(sample: OdometrySample) -> int:
    return sample.stamp
