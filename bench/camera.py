"""A picture of the ceiling camera: drawing it in the simulation, and finding robots in it."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import cv2
from result import Result

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Marker, Person, RobotGeometry, Scenario, Table
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.simulation.truth import PersonState
from tablerunner.types import ImageSample, Lens
from tablerunner.vision import (
    CameraMount,
    CeilingLocator,
    LocatorConfig,
    MarkerConfig,
    Observation,
)

ROUNDS, PICTURES = 5, 20
PERIOD_MS = 100.0
"""Between two pictures at 10 Hz."""

MARKERS = (Marker(), Marker((30, 190, 60)), Marker((30, 90, 220)))
HUES = (329.0, 131.0, 221.0)
CAMERA = Camera(
    (0.0, 0.0, 4.2),
    focal=(290.0, 290.0),
    distortion=(-0.13, 0.018, 0.0006, -0.0004, -0.001),
    clutter=30,
)
PEOPLE = tuple(Person(f'p{index}', ((index - 2.0, -1.9),)) for index in range(5))


def best_ms(run: Callable[[], object]) -> float:
    """Return the shortest processor time of several runs, per picture [ms]."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return min(times) / PICTURES * 1e3


def measure() -> Iterator[Result]:
    """Measure with one robot and with three, on one core."""
    cv2.setNumThreads(1)
    tables = tuple(
        Table(f't{x}{y}', x, y, (0, 0, 0), length=0.9) for x in (-2, 2) for y in (-1, 1)
    )
    scenario = Scenario(
        'bench',
        tables=tables,
        people=PEOPLE,
        camera=CAMERA,
        robot=RobotGeometry(),
        start=(0, 0, 0),
    )
    view = CeilingView(scenario, 0)
    people = [PersonState(item.name, Pose2(*item.route[0]), 0.0, item.radius) for item in PEOPLE]
    lens = Lens(CAMERA.width, CAMERA.height, CAMERA.focal, CAMERA.middle, CAMERA.distortion)
    for count in (1, 3):
        robots = [
            RobotView(Pose2(0.9 * index - 0.9, 0.1, index), 0.25, marker, 0.5, 0.2)
            for index, marker in enumerate(MARKERS[:count])
        ]
        words = f'{count} robot' + ('s' if count > 1 else '')
        drawn = best_ms(partial(_draw, view, robots, people))
        yield Result(
            f'camera picture, {words}',
            drawn,
            PERIOD_MS,
            drawn / PERIOD_MS,
            'ms',
            'drawing 640x480 with 5 people, on one core; reference: the time between two pictures',
            bound=0.3,
        )
        marker = MarkerConfig(
            robots=tuple(f'r{index}' for index in range(count)),
            hues=HUES[:count],
            heights=(MARKERS[0].height,) * count,
        )
        mount = CameraMount(view.camera.position, view.camera.yaw, view.camera.tilt)
        locator = CeilingLocator(LocatorConfig(mount=mount, marker=marker), lens)
        found = best_ms(partial(_look, locator, _draw(view, robots, people), itertools.count(1)))
        yield Result(
            f'camera finding, {words}',
            found,
            PERIOD_MS,
            found / PERIOD_MS,
            'ms',
            'a 640x480 picture to poses, on one core; reference: the time between two pictures',
            bound=0.15,
        )


def _draw(
    view: CeilingView, robots: Sequence[RobotView], people: Sequence[PersonState]
) -> list[Any]:
    return [view.draw(index / 10.0, robots, people) for index in range(PICTURES)]


def _look(locator: CeilingLocator, pictures: Sequence[Any], stamps: Iterator[int]) -> None:
    for picture in pictures:
        for seen in locator.add(ImageSample(next(stamps), picture)):
            if not isinstance(seen, Observation):
                raise RuntimeError(f'{seen.key}: {seen.reason}')
