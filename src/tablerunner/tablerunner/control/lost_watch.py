"""Whether the robot knows where it is well enough to drive, and since when it does not."""

from __future__ import annotations

from tablerunner.control.destination import Situation
from tablerunner.control.mission_config import MissionConfig
from tablerunner.types import seconds


class LostWatch:
    """Judges one situation after the other.

    Attributes
    ----------
    aligning : bool
        Whether the position is known and the heading is being looked for by driving.
    """

    def __init__(self) -> None:
        self._since: int | None = None
        self.aligning = False

    def restart(self) -> None:
        """Begin anew: the time that was spent does not count."""
        self._since, self.aligning = None, False

    @property
    def is_lost(self) -> bool:
        """Whether the pose cannot be driven on."""
        return self._since is not None

    def lost_s(self, stamp: int) -> float:
        """Return for how long that has been so [s]."""
        return 0.0 if self._since is None else seconds(stamp - self._since)

    def look(self, situation: Situation, config: MissionConfig) -> str:
        """Judge a situation; return in words what has changed, or ''."""
        known = (
            situation.pose is not None
            and situation.pose.is_finite
            and seconds(situation.stamp - situation.pose_stamp) <= config.pose_timeout
            and situation.position_std_m <= config.position_std_limit
        )
        heading = config.heading_std_found if self.aligning else config.heading_std_lost
        if known and situation.heading_std_rad <= heading:
            event = 'localised' if self.is_lost else ''
            self.restart()
            return event
        event = ''
        if self._since is None:
            self._since = situation.stamp
            event = 'heading not known' if known else 'not localised'
        self.aligning = known and self.lost_s(situation.stamp) >= config.align_after
        return event
