"""The way to one stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.control.floor_map import Disc
from tablerunner.control.path import Path

_NOWHERE = Disc(math.nan, math.nan, 0.0)


@dataclass
class Leg:
    """What concerns the way to one stop only.

    Attributes
    ----------
    replan_at : float
        Time without progress at which a way around is looked for next [s].
    path : Path or None
        What is being followed.
    distance_left : float
        Along it [m]; NaN: not known.
    begun : bool
        Whether the robot has been localised on this leg.
    taken_s : float
        Time since then, without pauses.
    plan_again : int
        Not before this stamp [ns].
    plan_tries : int
        How often there was no way.
    blocked_s : float
        Time blocked, in all.
    stuck : bool
        Whether it is time to look around.
    retreat_until : int
        Until this stamp the robot makes way for somebody [ns]; 0: it does not.
    retreat_from : Disc
        Where he stands.
    retreated : bool
        Whether it stands where it went for that.
    retreat_again : int
        Not before this stamp [ns].
    """

    replan_at: float
    path: Path | None = None
    distance_left: float = math.nan
    begun: bool = False
    taken_s: float = 0.0
    plan_again: int = 0
    plan_tries: int = 0
    blocked_s: float = 0.0
    stuck: bool = False
    retreat_until: int = 0
    retreat_from: Disc = _NOWHERE
    retreated: bool = False
    retreat_again: int = 0
