"""Sun's track keeping: hold the direction inside a corridor round the track, correct outside it.

Sun et al. 2019, 2.6: inside the corridor the running attitude is held; a robot that has left it to
the left (right) gets a faster left (right) wheel, by fuzzy control of the wheels' difference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.control.fuzzy.base_file import load_base
from tablerunner.control.fuzzy.reactive import require_inputs
from tablerunner.control.fuzzy.rule_base import RuleBase
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.control.path import Path
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

TRACK_INPUTS = ('deviation', 'heading_error')

_LOOK_BACK_M = 0.3  # progress may step back a little: the pose is corrected
_LOOK_ON_M = 1.0  # never to another leg


@dataclass(frozen=True)
class TrackConfig(Config):
    """The corridor, and how the robot comes back to it."""

    half_width: float = parameter(
        0.05,
        description='The corridor reaches this far to either side of the track',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    return_share: float = parameter(
        0.3,
        description='Correcting ends within this share of the half width',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    hold_gain: float = parameter(
        2.0,
        description='Turn rate over heading error, inside the corridor',
        unit='1/s',
        above=0.0,
        dynamic=True,
    )
    max_difference: float = parameter(
        0.3,
        description="Largest difference of the wheels' speeds",
        unit='m/s',
        above=0.0,
        dynamic=True,
    )
    lookahead: float = parameter(
        0.2,
        description='The direction of the track is that to the point so far ahead',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    preview: float = parameter(
        0.5,
        description='A bend so far ahead slows the robot already',
        unit='m',
        low=0.0,
        dynamic=True,
    )
    bend_share: float = parameter(
        0.3,
        description='Least share of the speed before a bend',
        above=0.0,
        high=1.0,
        dynamic=True,
    )


@dataclass(frozen=True, slots=True)
class TrackStep:
    """One step along the track.

    Attributes
    ----------
    velocity : Velocity
    left_m_s, right_m_s : float
        The same as speeds of the wheels.
    deviation_m : float
        Of the robot from the track, to its left positive.
    heading_error_rad : float
        Of the robot from the track's direction, counter-clockwise positive.
    correcting : bool
        Whether the robot left the corridor and is on its way back.
    left_over_m : float
        Way along the track to its end.
    trace : Trace or None
        While correcting, where asked for.
    """

    velocity: Velocity
    left_m_s: float
    right_m_s: float
    deviation_m: float
    heading_error_rad: float
    correcting: bool
    left_over_m: float
    trace: Trace | None = None


class TrackKeeper:
    """Keeps a robot near one track at a time; deterministic.

    Parameters
    ----------
    config : TrackConfig
    track_m : float
        Distance between the wheels.
    base : RuleBase, optional
        ``sun_track`` by default.

    Raises
    ------
    ConfigError
        The rule base has other inputs than those that are measured.
    """

    def __init__(self, config: TrackConfig, track_m: float, base: RuleBase | None = None) -> None:
        self.config = config
        self.track_m = track_m
        self.base = require_inputs(base or load_base('sun_track'), TRACK_INPUTS)
        self._path: Path | None = None
        self._arc = 0.0
        self._correcting = False

    def follow(self, path: Path) -> None:
        """Take a new track, from its beginning."""
        self._path = path
        self._arc = 0.0
        self._correcting = False

    def step(self, pose: Pose2, speed_m_s: float, traced: bool = False) -> TrackStep:
        """Return how to drive on at `speed_m_s` with the robot at `pose` (base_link in map).

        Turning away from a sharp corner slows the robot: it drives at the part of the speed that
        points along the track, the slower the nearer the wheels' difference is to the largest,
        and turns on the spot at the largest.

        Raises
        ------
        ValueError
            There is no track, it is but a point, or the pose is not finite.
        """
        path = self._path
        if path is None or len(path.points) < 2:
            raise ValueError('there is no track to keep')
        if not pose.is_finite:
            raise ValueError('the pose is not finite')
        config = self.config
        low, high = self._arc - _LOOK_BACK_M, self._arc + _LOOK_ON_M
        self._arc, away = path.project(pose.x, pose.y, low, high)
        deviation = self._signed(path, pose, away)
        heading_error = difference(pose.heading, self._direction(path, config.lookahead))
        bend = difference(pose.heading, self._direction(path, config.preview))
        edge = config.half_width * (config.return_share if self._correcting else 1.0)
        self._correcting = away > edge
        trace = None
        if self._correcting:
            degrees = math.degrees(heading_error)
            share = self.base.infer_one(deviation, degrees)
            apart = config.max_difference * share
            if traced:
                trace = self.base.trace({'deviation': deviation, 'heading_error': degrees})
        else:
            apart = -config.hold_gain * heading_error * self.track_m
        apart = min(max(apart, -config.max_difference), config.max_difference)
        before_bend = max(math.cos(bend), config.bend_share)
        # Turn first, then drive: on its way round a corner the robot would drift off sideways.
        turning = 2.0 - 2.0 * (apart / config.max_difference) ** 2
        forward = speed_m_s * max(min(math.cos(heading_error), before_bend, turning), 0.0)
        return TrackStep(
            Velocity(forward, apart / self.track_m),
            forward - apart / 2.0,
            forward + apart / 2.0,
            deviation,
            heading_error,
            self._correcting,
            path.length - self._arc,
            trace,
        )

    def _direction(self, path: Path, ahead_m: float) -> float:
        """Return the direction of the track so far ahead of the robot [rad]."""
        end = min(self._arc + ahead_m, path.length)
        along = path.at(end) - path.at(end - min(self.config.lookahead, path.length))
        return math.atan2(along[1], along[0])

    def _signed(self, path: Path, pose: Pose2, away: float) -> float:
        """Return the deviation from the track, positive to its left."""
        before = path.at(min(self._arc, path.length - 1e-3))
        along = path.at(self._arc + 1e-3) - before
        foot = path.at(self._arc)
        side = along[0] * (pose.y - foot[1]) - along[1] * (pose.x - foot[0])
        return math.copysign(away, side)
