"""What a demo shows besides the meals: each is judged by the truth, and told."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tablerunner.bags.reader import BagReader
from tablerunner.control import Path
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Scenario
from tablerunner.types import Matrix
from tablerunner_bringup.emergency_drill import DrillReport

HELD_M = 0.02
"""A robot that stands may be measured to move by so much."""

_SPACING_M = 0.05


@dataclass(frozen=True)
class Check:
    """One thing that was to be shown.

    Attributes
    ----------
    name, words : str
        What, and how it went.
    passed : bool
    numbers : dict of str to float
        That it was judged by.
    """

    name: str
    passed: bool
    words: str
    numbers: dict[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {'passed': self.passed, 'words': self.words, **self.numbers}


def plans_of(bag: BagReader, topic: str = '/plan') -> list[Matrix]:
    """Return the planned ways of a bag, each of shape (n, 2), in map [m]."""
    plans = []
    for item in bag.messages([topic] if bag.topic(topic) else []):
        poses = [stamped.pose.position for stamped in item.message.poses]
        if len(poses) > 1:
            way = Path(np.array([(place.x, place.y) for place in poses]))
            plans.append(way.resampled(_SPACING_M))
    return plans


def driven_of(bag: BagReader, topic: str = '/ground_truth') -> Matrix:
    """Return where the robot truly was, shape (n, 2), in map [m]."""
    places = [
        item.message.pose.pose.position
        for item in bag.messages([topic] if bag.topic(topic) else [])
    ]
    return np.array([(place.x, place.y) for place in places]).reshape(-1, 2)


def checks_of(bag: BagReader, scenario: Scenario, drill: DrillReport) -> list[Check]:
    """Judge all that was to be shown on a recorded run; empty where nothing was driven."""
    driven = driven_of(bag)
    if not len(driven):
        return []
    plans = plans_of(bag)
    return [
        *blocked_ways(scenario, plans, driven),
        *people_in_the_way(scenario, plans, driven),
        emergency(drill),
    ]


def blocked_ways(scenario: Scenario, plans: Sequence[Matrix], driven: Matrix) -> list[Check]:
    """Judge each box that the map does not know: a plan led through it, and nothing touched it.

    Parameters
    ----------
    scenario : Scenario
    plans : sequence of ndarray, shape (n, 2)
    driven : ndarray, shape (m, 2)
        Where the robot truly was [m].
    """
    checks = []
    radius = scenario.robot.footprint_radius
    for box in scenario.boxes:
        if not box.unmapped:
            continue
        outline = box.outline
        through = sum(_closed(plan, outline.segments, radius) for plan in plans)
        gap = float(distance_to_segments(driven, outline.segments).min()) - radius
        checks.append(_encounter(f'way blocked by {box.name}', through, gap))
    return checks


def people_in_the_way(scenario: Scenario, plans: Sequence[Matrix], driven: Matrix) -> list[Check]:
    """Judge each person who stands: a plan led through where they stand, nothing touched them."""
    checks = []
    radius = scenario.robot.footprint_radius
    for person in scenario.people:
        if len(person.route) > 1:
            continue
        place = np.array(person.route[0])
        reach = radius + person.radius
        through = sum(_nearest(plan, place) < reach for plan in plans)
        gap = _nearest(driven, place) - reach
        checks.append(_encounter(f'{person.name} in the way', through, gap))
    return checks


def emergency(report: DrillReport) -> Check:
    """Judge an emergency stop and its release."""
    numbers = dict(vars(report))
    if math.isnan(report.stopped_within_m):
        words = 'never tried' if math.isnan(report.speed_m_s) else 'the robot did not stand'
        return Check('emergency stop', False, words, numbers)
    words = (
        f'stood {report.stopped_within_m:.2f} m after the call at {report.speed_m_s:.2f} m/s '
        f'(at most {report.allowed_m:.2f} m), moved {100 * report.moved_while_held_m:.1f} cm '
        f'while held, '
    )
    went_on = not math.isnan(report.drove_on_after_s)
    words += (
        f'drove on {report.drove_on_after_s:.1f} s after the release'
        if went_on
        else ('did not drive on after the release')
    )
    passed = (
        report.stopped_within_m <= report.allowed_m
        and report.moved_while_held_m <= HELD_M
        and went_on
    )
    return Check('emergency stop', passed, words, numbers)


def failures(checks: Iterable[Check]) -> list[str]:
    """Return in words what did not pass."""
    return [f'{check.name}: {check.words}' for check in checks if not check.passed]


def _encounter(name: str, plans: int, gap_m: float) -> Check:
    numbers = {'plans_through_it': float(plans), 'least_distance_m': gap_m}
    if not plans:
        return Check(name, False, 'no planned way led there: nothing was shown', numbers)
    words = f'{plans} planned ways led there; passed with {100 * gap_m:.0f} cm to spare at least'
    return Check(name, gap_m > 0.0, words if gap_m > 0.0 else 'it was touched', numbers)


def _closed(plan: Matrix, segments: Matrix, radius: float) -> bool:
    return bool(distance_to_segments(plan, segments).min() < radius)


def _nearest(points: Matrix, place: Matrix) -> float:
    return float(np.hypot(*(points - place).T).min())
