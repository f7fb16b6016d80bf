"""Positions from ranges that were measured one after another by a robot on the move.

A fix takes its ranges to be of one instant. At 0.2 m/s and 3 Hz the robot moves 7 cm while a round
of them is measured; where two anchors stand in line with the way, that becomes a decimetre across
it, always to the same side. Odometry knows how the robot moved: each range is carried to the
instant of the first one of its round.
"""

from __future__ import annotations

import math
from dataclasses import replace

from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.track import OdometryTrack
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Anchor, PoseSample, RangeSample, Refusal, nanoseconds
from tablerunner.uwb import Positioner, PositionerConfig


class FixMaker:
    """Carries ranges to one instant and hands them to a positioner.

    Parameters
    ----------
    config : PositionerConfig
        Its `tag_height` gives way to the height of the lever arm.
    anchors : tuple of Anchor
    lever_arm : tuple
        Tag in base_link [m].
    """

    def __init__(
        self, config: PositionerConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> None:
        self._lever_arm = lever_arm
        self._anchors = {anchor.anchor_id: anchor for anchor in anchors}
        self._positioner = Positioner(config.replace(tag_height=lever_arm[2]), anchors)
        self._instant = 0

    def configure(self, config: PositionerConfig) -> None:
        """Use other dynamic settings from now on."""
        self._positioner.config = config.replace(tag_height=self._lever_arm[2])

    def reset(self) -> None:
        """Drop the round that is being gathered."""
        self._positioner.reset()

    def add(
        self, sample: RangeSample, map_to_odom: Pose2, track: OdometryTrack
    ) -> PoseSample | Refusal | None:
        """Take a range; return the position of the tag when a round is complete.

        Parameters
        ----------
        sample : RangeSample
        map_to_odom : Pose2
            Where odom is believed to lie in map; only the direction to the anchor hangs on it.
        track : OdometryTrack
            Must reach back to `sample.stamp`.
        """
        longest = nanoseconds(self._positioner.config.epoch)
        late = abs(sample.stamp - self._instant) > longest
        # An anchor that answers again, since another was not heard, begins a round of its own.
        if not self._positioner.gathered or late or self._positioner.holds(sample.anchor_id):
            self._instant = sample.stamp
        anchor = self._anchors[sample.anchor_id]
        then, first = (
            self._distance(map_to_odom @ track.pose(stamp), anchor)
            for stamp in (sample.stamp, self._instant)
        )
        carried = replace(
            sample, stamp=self._instant, range_m=max(sample.range_m + first - then, 0.0)
        )
        fix = self._positioner.add(carried)
        return replace(fix, point=self._lever_arm[:2]) if isinstance(fix, PoseSample) else fix

    def _distance(self, pose: Pose2, anchor: Anchor) -> float:
        x, y, z = self._lever_arm
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        return math.dist(
            (pose.x + cos * x - sin * y, pose.y + sin * x + cos * y, z), anchor.position
        )
