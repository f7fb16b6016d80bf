"""What a survey is made of, and what comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablerunner.odometry import MotionNoise
from tablerunner.survey.track import Track

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Indices = NDArray[np.intp]

RANGE_STD_M = 0.1
"""What a range is believed to err before its noise is found."""


@dataclass(frozen=True)
class RangeTable:
    """Ranges between the robot's tag and anchors.

    Attributes
    ----------
    ids : tuple of str
        Names of the anchors.
    stamps : ndarray of int64, shape (m,)
        [ns].
    anchor : ndarray of int, shape (m,)
        Index into `ids`.
    range_m : ndarray, shape (m,)
    """

    ids: tuple[str, ...]
    stamps: Stamps
    anchor: Indices
    range_m: Array

    def within(self, track: Track) -> RangeTable:
        """Return those measured while a track lasts."""
        kept = (self.stamps >= track.stamps[0]) & (self.stamps <= track.stamps[-1])
        return RangeTable(self.ids, self.stamps[kept], self.anchor[kept], self.range_m[kept])

    def counts(self) -> NDArray[np.intp]:
        """Return the number of ranges of each anchor."""
        return np.bincount(self.anchor, minlength=len(self.ids))


@dataclass(frozen=True)
class SurveyData:
    """What was recorded on a drive.

    Attributes
    ----------
    track : Track
        Of base_link by dead reckoning.
    ranges : RangeTable
    tag_position : tuple
        Tag in base_link; z is its height over the floor [m].
    links : mapping of (str, str) to ndarray
        Ranges between two anchors, as often as they were measured [m].
    """

    track: Track
    ranges: RangeTable
    tag_position: tuple[float, float, float]
    links: Mapping[tuple[str, str], Array] = field(default_factory=dict)


@dataclass(frozen=True)
class SurveyConfig:
    """What is known before.

    Attributes
    ----------
    heights : mapping of str to float
        Known heights of anchors over the floor [m]; those of others are estimated.
    fixed : mapping of str to tuple
        Places that are given, x, y or x, y, z [m]: two anchors or more, or none.
    start : tuple
        x, y, heading of base_link in map at the start [m, m, rad]; not used where anchors are
        given.
    usual_height_m, height_std_m : float
        What is believed of an unknown height over that of the tag, and its deviation.
    bias_std_m, scale_std : float
        How wrong ranges of an anchor are believed to be all the time: by a constant [m], and by a
        share. 0: not at all.
    noise : MotionNoise
        Of the odometry, to begin with: it is found, too.
    """

    heights: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    usual_height_m: float = 1.0
    height_std_m: float = 1.0
    bias_std_m: float = 0.1
    scale_std: float = 0.005
    noise: MotionNoise = field(default_factory=MotionNoise)


@dataclass(frozen=True)
class SurveyedAnchor:
    """Where an anchor hangs.

    Attributes
    ----------
    anchor_id : str
    position : ndarray, shape (3,)
        In map [m].
    covariance : ndarray, shape (3, 3)
        Zero where a coordinate was given.
    bias_m, bias_std_m : float
        What its ranges read too long.
    scale : float
        By which share they read too long.
    ranges : int
        How many there were.
    blocked : float
        Share of them that do not fit and were left out.
    """

    anchor_id: str
    position: Array
    covariance: Array
    bias_m: float
    bias_std_m: float
    scale: float
    ranges: int
    blocked: float

    @property
    def std(self) -> Array:
        """Standard deviations of x, y, z, shape (3,) [m]."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


@dataclass(frozen=True)
class Survey:
    """What came out.

    Attributes
    ----------
    anchors : tuple of SurveyedAnchor
        In the order of their names in the data.
    covariance : ndarray, shape (3 n, 3 n)
        Of x, y, z of all anchors.
    left_out : mapping of str to int
        Anchors with too few ranges, and how many those were.
    path : ndarray, shape (k, 3)
        x, y, heading of base_link at the knots, in map.
    residuals : mapping of str to ndarray
        Of the ranges of each anchor: measured less expected [m].
    range_std_m : float
        Noise of a range that is not blocked.
    way, turns, drift : tuple of 2 floats
        Share by which odometry tells way and turns too short, its drift in the beginning [rad/s],
        each with its standard deviation.
    """

    anchors: tuple[SurveyedAnchor, ...]
    covariance: Array
    left_out: Mapping[str, int]
    path: Array
    residuals: Mapping[str, Array]
    range_std_m: float
    way: tuple[float, float]
    turns: tuple[float, float]
    drift: tuple[float, float]

    @property
    def positions(self) -> Array:
        """Places of the anchors, shape (n, 3) [m]."""
        return np.array([item.position for item in self.anchors])
