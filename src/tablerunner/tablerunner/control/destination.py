"""Where a mission leads, what it knows each step, and what it tells."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from tablerunner.control.path import Path
from tablerunner.geometry.pose import Pose2


class MissionState(str, Enum):
    """What the robot is doing; the values are the words of the action's feedback."""

    IDLE = 'idle'
    LOCALISING = 'waiting for localisation'
    ALIGNING = 'finding its heading'
    PLANNING = 'planning'
    DRIVING = 'driving'
    BLOCKED = 'blocked'
    HELD = 'held by the safety stop'
    WAITING = 'waiting'
    HANDING_OVER = 'waiting for confirmation'
    PAUSED = 'paused'
    RETURNING = 'returning'
    DONE = 'done'
    CANCELLED = 'cancelled'
    FAILED = 'failed'

    @property
    def is_final(self) -> bool:
        """Whether nothing is under way."""
        return self in _FINAL


_FINAL = (MissionState.IDLE, MissionState.DONE, MissionState.CANCELLED, MissionState.FAILED)


@dataclass(frozen=True, slots=True)
class Destination:
    """One place to go to.

    Attributes
    ----------
    name : str
        For people and for the result.
    pose : Pose2
        Of base_link in map.
    wait_s : float
        How long to stand there at least [s].
    confirm_s : float
        How long to wait there for a confirmation at most, from the arrival [s]; 0: none is wanted.
    keep_heading : bool
        Whether the heading of `pose` is asked for.
    """

    name: str
    pose: Pose2
    wait_s: float = 0.0
    confirm_s: float = 0.0
    keep_heading: bool = True


@dataclass(frozen=True, slots=True)
class Situation:
    """What a mission knows at one step.

    Attributes
    ----------
    stamp : int
        Of this step [ns].
    pose : Pose2 or None
        base_link in map; None: not known.
    pose_stamp : int
        When that was [ns].
    position_std_m, heading_std_rad : float
        How certain it is (largest standard deviation).
    blocked : bool
        Whether the safety stop holds the robot for something in its way.
    obstacle : tuple of float or None
        Where that is, in base_link [m].
    held : bool
        Whether the safety stop holds the robot for another reason: emergency stop, silence.
    """

    stamp: int
    pose: Pose2 | None = None
    pose_stamp: int = 0
    position_std_m: float = math.inf
    heading_std_rad: float = math.inf
    blocked: bool = False
    obstacle: tuple[float, float] | None = None
    held: bool = False


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """What a mission tells after each step.

    Attributes
    ----------
    state : MissionState
    stop_index : int
        Of the stop it is going to or standing at; the number of stops: home.
    stop : str
        Its name.
    distance_left : float
        Along the path to that stop [m]; NaN: no path.
    path : Path or None
        What is being followed.
    reached : tuple of str
    missed : tuple of (str, str)
        Names of stops and why.
    unconfirmed : tuple of str
        Stops that were reached and where nobody confirmed in time.
    events : tuple of str
        What happened in this step, in words.
    message : str
        The outcome in one sentence once the state is final.
    """

    state: MissionState
    stop_index: int = 0
    stop: str = ''
    distance_left: float = math.nan
    path: Path | None = None
    reached: tuple[str, ...] = ()
    missed: tuple[tuple[str, str], ...] = ()
    unconfirmed: tuple[str, ...] = ()
    events: tuple[str, ...] = ()
    message: str = ''
