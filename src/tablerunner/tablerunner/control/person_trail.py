"""The way that a person has walked: where a person could go there is room, round corners too."""

from __future__ import annotations

import math
from itertools import pairwise

Point = tuple[float, float]

_SPACING_M = 0.4  # crumbs nearer to each other tell more of noise than of the way
_LONGEST = 50  # crumbs: 20 m
_REACHED_M = 0.5  # a crumb so near has been reached
_DETOUR, _SLACK_M = 2.0, 2.0  # the way is no longer than the straight line times and plus


class PersonTrail:
    """Crumbs in a frame that does not jump, such as odom; those behind the robot are dropped."""

    def __init__(self) -> None:
        self._points: list[Point] = []

    def reset(self) -> None:
        """Forget the way."""
        self._points.clear()

    @property
    def end(self) -> Point | None:
        """The newest crumb [m]; None: there is none."""
        return self._points[-1] if self._points else None

    def add(self, place: Point) -> None:
        """Take where the person is now [m]."""
        if not self._points or math.dist(self._points[-1], place) >= _SPACING_M:
            self._points.append(place)
            del self._points[:-_LONGEST]

    def aim(self, robot: Point, person: Point, cut_m: float) -> Point:
        """Return the farthest point of the way that can be made for straight on [m].

        Parameters
        ----------
        robot : tuple of float
            Where base_link is.
        person : tuple of float
            The end of the way: where the person is now.
        cut_m : float
            The straight line leaves the way that was walked by no more than this.
        """
        self._shorten(robot, person)
        way = [*self._points, person]
        passed = _passed(way, robot)
        del self._points[: min(passed, len(self._points) - 1)]
        way = way[passed:]
        # The first of it may lie behind the robot already: what counts is what comes after.
        for last in range(len(way) - 1, 1, -1):
            if all(_away(point, robot, way[last]) <= cut_m for point in way[1:last]):
                return way[last]
        return way[min(1, len(way) - 1)]

    def _shorten(self, robot: Point, person: Point) -> None:
        """Drop crumbs that lie farther back than a robot that is so near can be."""
        most = _DETOUR * math.dist(robot, person) + _SLACK_M
        length, last = 0.0, person
        for index in range(len(self._points) - 1, -1, -1):
            length += math.dist(last, self._points[index])
            last = self._points[index]
            if length > most:
                del self._points[:index]
                return


def _passed(way: list[Point], place: Point) -> int:
    """Return which part of a way is nearest to a place, or the last one that is reached."""
    best, answer = math.inf, 0
    for index, (here, there) in enumerate(pairwise(way)):
        away = _away(place, here, there)
        if away < best:
            best, answer = away, index
        if math.dist(place, there) < _REACHED_M and index + 2 < len(way):
            best, answer = 0.0, index + 1
    return answer


def _away(place: Point, here: Point, there: Point) -> float:
    """Return how far a place is from the straight line between two others [m]."""
    along = (there[0] - here[0], there[1] - here[1])
    square = along[0] ** 2 + along[1] ** 2
    share = 0.0
    if square > 0.0:
        dot = (place[0] - here[0]) * along[0] + (place[1] - here[1]) * along[1]
        share = min(max(dot / square, 0.0), 1.0)
    return math.dist((here[0] + share * along[0], here[1] + share * along[1]), place)
