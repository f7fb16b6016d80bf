"""Which echoes are those of the person who is followed."""

from __future__ import annotations

import math

import numpy as np

from tablerunner.control.fuzzy.readings import Readings
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PersonSample

HALF_CONE_RAD = 0.24
_SIGMAS = 2.0
_LEAST_M = 0.1  # noise of the echo, a step since the reading
_HALF_WIDTH_M = 0.35  # of the way ahead: the hull and a little
_TOUCHING_M = 0.15


def without_person(
    readings: Readings, mounts: tuple[Pose2, ...], person: PersonSample, radius: float
) -> Readings:
    """Return the readings without what may be the person: inf, as if nothing had echoed.

    An echo is the person's if the person may stand in the sensor's cone and it comes from no
    nearer than the near side of the body, allowing for how well the place is known. What stands
    nearer is in between; what is behind the person is of no concern.

    Parameters
    ----------
    readings : Readings
    mounts : tuple of Pose2
        Of the sensors, in base_link.
    person : PersonSample
    radius : float
        The tag is somewhere on a body of this radius [m]: the body reaches no farther from the
        tag than its diameter.
    """
    spread = person.covariance[:2, :2]
    distances = list(readings.distances_m)
    for index, (distance, mount) in enumerate(zip(readings.distances_m, mounts, strict=True)):
        if not distance < math.inf:
            continue
        ahead = np.array([person.position[0] - mount.x, person.position[1] - mount.y])
        away = max(float(np.hypot(ahead[0], ahead[1])), 1e-6)
        along = ahead / away
        across = np.array([-along[1], along[0]])
        deep = _SIGMAS * math.sqrt(max(float(along @ spread @ along), 0.0))
        wide = _SIGMAS * math.sqrt(max(float(across @ spread @ across), 0.0))
        bearing = difference(math.atan2(ahead[1], ahead[0]), mount.heading)
        half = HALF_CONE_RAD + math.atan2(2.0 * radius + wide, away)
        nearest = away - 2.0 * radius - deep - _LEAST_M
        if abs(bearing) <= half and distance >= nearest:
            distances[index] = math.inf
    a, b, c, d, e = distances
    return Readings((a, b, c, d, e), readings.ages_s)


def in_the_way(
    readings: Readings,
    mounts: tuple[Pose2, ...],
    target: tuple[float, float],
    notice: float,
    surely: bool = True,
) -> bool:
    """Return whether what the three sensors ahead hear stands between base_link and a target.

    An echo may come from anywhere on an arc. It is surely in the way when the whole arc is near
    the straight line to the target, and may be when a part of it is; and whatever is so near that
    any turn would meet it is.

    Parameters
    ----------
    readings : Readings
    mounts : tuple of Pose2
        Of the sensors, in base_link.
    target : tuple of float
        In base_link [m].
    notice : float
        What is farther from the sensor is not looked at [m].
    surely : bool
        Whether it has to be for sure.
    """
    away = max(math.hypot(*target), 1e-6)
    along = target[0] / away, target[1] / away
    for distance, mount in list(zip(readings.distances_m, mounts, strict=True))[1:4]:
        if not distance < notice:
            continue
        if distance < _TOUCHING_M:
            return True
        courses = [mount.heading + side * HALF_CONE_RAD for side in (-1.0, 0.0, 1.0)]
        points = [
            (mount.x + distance * math.cos(course), mount.y + distance * math.sin(course))
            for course in courses
        ]
        near = [
            x * along[0] + y * along[1] > 0.0 and abs(y * along[0] - x * along[1]) <= _HALF_WIDTH_M
            for x, y in points
        ]
        if all(near) if surely else any(near):
            return True
    return False
