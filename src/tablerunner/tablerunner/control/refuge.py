"""Where the robot makes way for somebody who cannot pass it.

Two who wait for each other wait for ever. People step aside without thinking; a robot in a door or
a narrow aisle has to drive out of it.
"""

from __future__ import annotations

import numpy as np

from tablerunner.control.floor_map import Disc
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner
from tablerunner.errors import PlanningError
from tablerunner.geometry.pose import Pose2

_REACH_M = 3.0  # straight; the way there may be twice as long
_SPACE_M = 0.3  # hull to what is on the map: room to pass by
_FREED_M = 1.6  # from the other one: beyond where people mind a robot
_BESIDE_M = 0.8  # from the path that the robot could not take
_PATH_M = 2.5  # so much of it matters
_TRIES = 3


def way_to_refuge(
    planner: Planner, pose: Pose2, other: Disc, path: Path, left: float
) -> Path | None:
    """Return a way to where the robot is in nobody's way; None: there is no such place near.

    Parameters
    ----------
    planner : Planner
        Of the floor with all that was found on it.
    pose : Pose2
        base_link in map.
    other : Disc
        Who stands in the way.
    path : Path
        What the robot was following.
    left : float
        What is left of it [m].
    """
    floor = planner.floor
    centres = floor.centres()
    away = np.hypot(centres[:, 0] - pose.x, centres[:, 1] - pose.y)
    fit = (away <= _REACH_M) & (floor.distance.ravel() >= planner.footprint_radius + _SPACE_M)
    fit &= np.hypot(centres[:, 0] - other.x, centres[:, 1] - other.y) >= _FREED_M
    places, away = centres[fit], away[fit]
    if not len(places):
        return None
    begin = max(path.length - left, 0.0)
    arcs = np.linspace(begin, min(begin + _PATH_M, path.length), 12)
    ahead = np.array([path.at(float(arc)) for arc in arcs])
    off = np.min(np.linalg.norm(places[:, None] - ahead[None], axis=2), axis=1)
    price = away + 2.0 * np.maximum(_BESIDE_M - off, 0.0)
    for index in np.argsort(price)[: 40 * _TRIES : 40]:  # neighbours are no other try
        try:
            way = planner.plan(pose, Pose2(*places[index]), keep_heading=False, blocked=(other,))
        except PlanningError:
            continue
        if way.length <= 2.0 * _REACH_M:
            return way
    return None
