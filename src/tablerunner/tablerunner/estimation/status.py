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


class Cause(Enum):
    """What carries the pose: measurements and odometry, or mostly one of them and why."""

    FUSED = 'fused'
    CHOSEN = 'the estimator takes no measurements'
    SWITCHED_OFF = 'switched off'
    SILENT = 'no measurements'
    REFUSED = 'measurements refused'
    BLOCKED = 'all anchors blocked'
    ONE_ANCHOR = 'one anchor only'
    DISAGREE = 'UWB and odometry disagree'  # and wheels that slip cannot explain it
    SLIP = 'wheels slip'


@dataclass(frozen=True, slots=True)
class LocalizerStatus:
    """State and what to say about it."""

    state: LocalizerState
    words: str
    dead_reckoning_s: float = 0.0  # time since a measurement was last accepted
    cause: Cause | None = None  # None: there is no pose yet that something could carry

    @property
    def trusted(self) -> bool:
        """Whether navigation may use the pose."""
        return self.state is LocalizerState.TRACKING

    @property
    def degraded(self) -> bool:
        """Whether the pose goes by less than measurements and odometry together, unwished."""
        return self.cause not in (None, Cause.FUSED, Cause.CHOSEN)


def tracking(
    cause: Cause, unfused_s: float, silence_s: float, *, withheld: bool = False
) -> LocalizerStatus:
    """Return the status of a localiser that has a pose, in words.

    Parameters
    ----------
    cause : Cause
        What carries the pose.
    unfused_s : float
        Time since a measurement was last accepted [s].
    silence_s : float
        For longer it is worth telling.
    withheld : bool
        Whether UWB is not taken because it disagrees.
    """
    words = LocalizerState.TRACKING.value
    if cause is Cause.SLIP or (cause is Cause.DISAGREE and not withheld):
        words = f'{words}: {cause.value}'
    elif cause is not Cause.FUSED:
        words = f'dead reckoning: {cause.value}'
        if unfused_s > silence_s:
            words += f', for {unfused_s:.1f} s'
    return LocalizerStatus(LocalizerState.TRACKING, words, unfused_s, cause)
