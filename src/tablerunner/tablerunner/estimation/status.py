"""In what state localisation is, for machines and for people."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class LocalizerState(Enum):
    """Where the localiser stands between knowing nothing and being trusted."""

    WAITING = 'waiting'  # for anchors, odometry or ranges
    ALIGNING = 'aligning'  # position perhaps, heading not yet
    TRACKING = 'tracking'  # the pose can be trusted as far as its covariance says
    LOST = 'lost'  # what is measured contradicts the pose; looking for it anew


@dataclass(frozen=True, slots=True)
class LocalizerStatus:
    """State and what to say about it."""

    state: LocalizerState
    words: str
    dead_reckoning_s: float = 0.0  # time since a measurement was last accepted

    @property
    def trusted(self) -> bool:
        """Whether navigation may use the pose."""
        return self.state is LocalizerState.TRACKING
