"""Up to where the marker is found: one thing made worse at a time, until it is lost.

A robot stands or drives at random places under a camera over an empty floor; counted are the
pictures in which it is found, and how wrong the place ever is. A marker that is missed is a gap; a
place that is wrong would be believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Light, Marker, RobotGeometry, Scenario, Wall
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.simulation.streams import stream
from tablerunner.types import Lens
from tablerunner.vision import CameraMount, CeilingCamera, MarkerConfig, MarkerFinder, Sighting

Array = NDArray[np.float64]

PICTURES = 25
"""Of each condition and seed."""

MARKER = Marker()
STEADY = Light(drift=0.0, tint=0.0, shadows=0)
CAMERA = Camera(
    (0.0, 0.0, 4.2),
    focal=(290.0, 290.0),
    distortion=(-0.13, 0.018, 0.0006, -0.0004, -0.001),
    light=STEADY,
    # The camera is known: what is asked for here is the finding alone.
    position_std=0.0,
    angle_std=0.0,
    focal_std=0.0,
)
USUAL_SPEED_M_S = 0.5

FOUND = 0.95
"""Share of pictures in which a marker must be found, up to the limit."""

WORST_M, WRONG_M = 0.015, 0.05
"""Largest error of a place up to the limit, and beyond it."""


@dataclass(frozen=True)
class Condition:
    """One thing that is made worse.

    Attributes
    ----------
    name, unit : str
    values : tuple of float
        The milder first, or around the usual one.
    limits : tuple of 2 floats
        Between which the marker must be found.
    change : callable
        Takes a value; returns the camera and the robot's speed [m/s].
    """

    name: str
    unit: str
    values: tuple[float, ...]
    limits: tuple[float, float]
    change: Callable[[float], tuple[Camera, float]]


def _light(**fields: float) -> tuple[Camera, float]:
    shadows = 12 if 'shadow_depth' in fields else 0
    light = STEADY.replace(**fields).replace(shadows=shadows)
    return CAMERA.replace(light=light), USUAL_SPEED_M_S


def _camera(**fields: Any) -> tuple[Camera, float]:
    return CAMERA.replace(**fields), USUAL_SPEED_M_S


CONDITIONS = (
    Condition(
        'light',
        'of the usual',
        (0.1, 0.2, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0),
        (0.3, 1.5),
        lambda value: _light(level=value),
    ),
    Condition(
        'tint',
        'of red and blue',
        (0.1, 0.2, 0.3, 0.5),
        (0.0, 0.1),
        lambda value: _light(tint=value),
    ),
    Condition(
        'shadows',
        'of the light',
        (0.3, 0.4, 0.5, 0.7, 0.9),
        (0.0, 0.4),
        lambda value: _light(shadow_depth=value),
    ),
    Condition(
        'clutter',
        'coloured things',
        (50.0, 200.0, 500.0),
        (0.0, 200.0),
        lambda value: _camera(clutter=round(value)),
    ),
    Condition(
        'noise',
        'grey levels',
        (4.0, 10.0, 20.0, 30.0),
        (0.0, 10.0),
        lambda value: _camera(noise=value),
    ),
    Condition(
        'blur',
        'pixel',
        (0.6, 1.0, 1.5, 2.5),
        (0.0, 1.0),
        lambda value: _camera(blur=value),
    ),
    Condition(
        'camera height',
        'm',
        (3.0, 4.2, 5.0, 6.0, 7.0),
        (0.0, 5.0),
        lambda value: _camera(position=(0.0, 0.0, value)),
    ),
    Condition(
        'speed',
        'm/s, 30 ms exposed',
        (0.7, 1.5, 3.0),
        (0.0, 0.7),
        lambda value: (CAMERA.replace(exposure=0.03), value),
    ),
)


def run_limits(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run every condition for many seeds."""
    cases = [
        (index, value) for index, condition in enumerate(CONDITIONS) for value in condition.values
    ]
    tasks = [(index, value, seed) for index, value in cases for seed in seeds]
    found = run_seeds(run_case, tasks, progress)
    rows = []
    results: dict[tuple[int, float], tuple[Spread, Spread]] = {}
    for case, first in zip(cases, range(0, len(found), len(seeds)), strict=True):
        some = found[first : first + len(seeds)]
        results[case] = (
            Spread.of([share for share, _ in some]),
            Spread.of([worst for _, worst in some]),
        )
    for (index, value), (share, worst) in results.items():
        condition = CONDITIONS[index]
        inside = condition.limits[0] <= value <= condition.limits[1]
        name = f'{condition.name} {value:g} {condition.unit}'
        rows.append(Row(f'{name}, found', '1', share, bound=Bound(low=FOUND) if inside else None))
        rows.append(
            Row(f'{name}, worst', 'm', worst, bound=Bound(high=WORST_M if inside else WRONG_M))
        )
    return Outcome(
        'camera_limits',
        'Up to where a marker is found, one thing made worse at a time',
        tuple(seeds),
        tuple(rows),
        partial(draw, results=results),
        {
            'pictures of each': PICTURES,
            'camera height [m]': CAMERA.position[2],
            'focal length [pixel]': CAMERA.focal[0],
        },
        (
            'The camera is known, so that errors are those of finding alone; a picture without '
            'a pose counts as not found, and has no error.',
            'Where no bound is asked for "found", the condition lies beyond the limit that '
            'docs/camera.md states; a place that is wrong is not allowed anywhere.',
        ),
    )


def run_case(task: tuple[int, float, int]) -> tuple[float, float]:
    """Return the share of pictures in which the robot was found, and the worst error [m]."""
    index, value, seed = task
    camera, speed = CONDITIONS[index].change(value)
    corners = ((-3.2, -2.5), (3.2, -2.5), (3.2, 2.5), (-3.2, 2.5))
    walls = (Wall(corners, 'outer wall', closed=True),) if camera.clutter else ()
    view = CeilingView(
        Scenario('limits', walls=walls, camera=camera, robot=RobotGeometry(marker=MARKER)), seed
    )
    lens = Lens(camera.width, camera.height, camera.focal, camera.middle, camera.distortion)
    config = MarkerConfig(hues=(329.0,), heights=(MARKER.height,))
    finder = MarkerFinder(
        config, CeilingCamera(lens, CameraMount(camera.position, camera.yaw, camera.tilt))
    )
    rng = stream(seed, f'camera limits {index}')
    # Well inside what the camera sees at the marker's height, 0.9 of it.
    drop = camera.position[2] - MARKER.height
    reach = 0.9 * drop * np.array([camera.width, camera.height]) / 2.0 / camera.focal - 0.25
    errors = []
    for _ in range(PICTURES):
        x, y = (float(number) for number in rng.uniform(-reach, reach))
        pose = Pose2(x, y, float(rng.uniform(-np.pi, np.pi)))
        robot = RobotView(pose, 0.25, MARKER, speed, float(rng.uniform(-0.5, 0.5)))
        picture = view.draw(float(rng.uniform(0.0, 100.0)), (robot,))
        seen = finder.find(picture)['robot']
        if isinstance(seen, Sighting):
            errors.append(seen.pose.distance_to(pose))
    return len(errors) / PICTURES, max(errors, default=0.0)


def draw(figure: Any, results: dict[tuple[int, float], tuple[Spread, Spread]]) -> None:
    """Draw the share found and the worst error over each thing that is made worse."""
    from tablerunner.evaluation.plots import style

    grid = figure.subplots(2, len(CONDITIONS) // 2, sharey=True).ravel()
    for index, (condition, axes) in enumerate(zip(CONDITIONS, grid, strict=True)):
        values = list(condition.values)
        shares = [results[index, value][0].mean for value in values]
        low, high = condition.limits
        axes.axvspan(max(low, min(values)), min(high, max(values)), color=style.GRID)
        axes.plot(values, shares, 'o-', color=style.ESTIMATE, markersize=3)
        axes.set_ylim(-0.05, 1.05)
        axes.set_xlabel(f'{condition.name} [{condition.unit}]')
    for axes in grid[:: len(CONDITIONS) // 2]:
        axes.set_ylabel('share found')
    grid[0].set_title('Found up to where it is grey', loc='left')
