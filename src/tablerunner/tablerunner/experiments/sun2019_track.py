"""Sun et al. 2019, 2.6: keeping to the square, the whole robot on what its own `ekf` believes.

The paper judges its localisation on a robot that keeps to a track, but does not say how well it
kept to it. Here the loop is closed: simulated ranges, wheels and gyro to the estimate, the
estimate to the controller, the controller through the safety stop to the wheels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import CONTROLLERS, Path
from tablerunner.errors import TablerunnerError
from tablerunner.experiments.closed_loop import LoopSettings
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.experiments.sun2019 import ANCHOR_HEIGHT_M, ROUTE, SIDE_M, START, TAG_HEIGHT_M
from tablerunner.experiments.track_loop import TrackLoop
from tablerunner.scenario import (
    AnchorPlace,
    ImuErrors,
    RobotGeometry,
    Scenario,
    SensorErrors,
    Wall,
    WheelErrors,
)

Array = NDArray[np.float64]

SQUARE = Path(np.array([START[:2], *ROUTE]))
BEYOND_M = 0.05
"""By how much the track error may exceed the localisation error, both root mean square."""

NEAR_CORNER_M = 0.5
_LONGEST_S = 300.0
_BACK_M, _ON_M = 0.5, 1.0  # progress along the track from one step to the next


@dataclass(frozen=True, eq=False)
class Tracked:
    """One drive round the square, at every control step with an estimate.

    Attributes
    ----------
    truth, believed : ndarray, shape (n, 2)
        Where base_link was in map, and where the `ekf` took it to be [m].
    track_m, control_m : ndarray, shape (n,)
        Distance of truth and of belief from the track.
    across_m : ndarray, shape (n,)
        What of the localisation error lies across the track.
    corner : ndarray of bool, shape (n,)
        Whether the robot was within `NEAR_CORNER_M` of a corner, along the track.
    time_s : float
    """

    truth: Array
    believed: Array
    track_m: Array
    control_m: Array
    across_m: Array
    corner: NDArray[np.bool_]
    time_s: float

    @classmethod
    def of(cls, truth: Array, believed: Array, time_s: float) -> Tracked:
        """Return the errors of a drive along `SQUARE`."""
        arcs, track = _along(truth)
        _, control = _along(believed)
        ends = SQUARE.arc
        leg = np.clip(np.searchsorted(ends, arcs, side='right') - 1, 0, len(ends) - 2)
        along = np.diff(SQUARE.points, axis=0)[leg]
        along /= np.linalg.norm(along, axis=1)[:, None]
        error = believed - truth
        across = along[:, 0] * error[:, 1] - along[:, 1] * error[:, 0]
        corner = np.abs(arcs[:, None] - ends[1:-1]).min(axis=1) < NEAR_CORNER_M
        return cls(truth, believed, track, control, across, corner, time_s)


def run_sun2019_track(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Drive the square with each controller for many seeds."""
    tasks = [(name, seed) for name in CONTROLLERS for seed in seeds]
    found = run_seeds(_run_task, tasks, progress)
    runs = {
        name: [run for task, run in zip(tasks, found, strict=True) if task[0] == name]
        for name in CONTROLLERS
    }
    return Outcome(
        'sun2019_track',
        'Sun et al. 2019, 2.6: keeping to the square on the ekf',
        tuple(seeds),
        tuple(row for name, some in runs.items() for row in _rows(name, some)),
        partial(draw, runs={name: some[0] for name, some in runs.items()}),
        {'square [m]': SQUARE.points.tolist(), 'corner within [m]': NEAR_CORNER_M},
        (
            'Track: root mean square over time of the true distance from the square, corners '
            'included. Localisation: the same of what of the error of the ekf lies across the '
            'track. Beyond localisation: the first less the second; its bound is on the worst '
            'seed. Control: the distance of the believed position from the square.',
            f'Corners: the same error within {NEAR_CORNER_M} m of the three corners that are '
            'driven round.',
            'The start is told, as in the demo; sensors have the errors of every scenario, '
            'wheels and gyro the rate of the paper (10 Hz).',
        ),
    )


def _rows(name: str, runs: Sequence[Tracked]) -> list[Row]:
    track = [rms(run.track_m) for run in runs]
    local = [rms(run.across_m) for run in runs]
    beyond = Spread.of(np.subtract(track, local))
    bound = Bound(high=BEYOND_M, of='high') if name == CONTROLLERS[0] else None
    return [
        Row(f'{name}, track, RMS', 'm', Spread.of(track)),
        Row(f'{name}, localisation, RMS', 'm', Spread.of(local)),
        Row(f'{name}, beyond localisation, RMS', 'm', beyond, bound=bound),
        Row(f'{name}, control, RMS', 'm', Spread.of([rms(run.control_m) for run in runs])),
        Row(
            f'{name}, track at corners, RMS',
            'm',
            Spread.of([rms(run.track_m[run.corner]) for run in runs]),
        ),
        Row(f'{name}, track, max', 'm', Spread.of([run.track_m.max() for run in runs])),
        Row(f'{name}, time, mean', 's', Spread.of([run.time_s for run in runs])),
    ]


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _run_task(task: tuple[str, int]) -> Tracked:
    return drive_square(*task)


def drive_square(name: str, seed: int) -> Tracked:
    """Drive the square once.

    Parameters
    ----------
    name : str
        One of `tablerunner.control.CONTROLLERS`.
    seed : int

    Raises
    ------
    TablerunnerError
        The robot did not come to the end of the square.
    """
    loop = TrackLoop(room(), seed, LoopSettings(controller=name))
    truth, believed, time_s = [], [], 0.0
    for step in loop.keep_to(SQUARE, _LONGEST_S):
        time_s = step.time_s
        if step.estimate is not None:
            truth.append((step.truth.pose.x, step.truth.pose.y))
            believed.append((step.estimate.pose.x, step.estimate.pose.y))
    if not loop.arrived:
        raise TablerunnerError(f'sun2019_track, {name}, seed {seed}: the square has no end')
    return Tracked.of(np.array(truth), np.array(believed), time_s)


def room() -> Scenario:
    """Return the paper's room: that of the scenario ``sun2019.yaml``."""
    corners = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M))
    return Scenario(
        name='sun2019',
        walls=(Wall(corners, 'outer wall', closed=True),),
        anchors=tuple(
            AnchorPlace(f'A{index}', (*corner, ANCHOR_HEIGHT_M))
            for index, corner in enumerate(corners)
        ),
        start=START,
        robot=replace(RobotGeometry(), tag_position=(0.0, 0.0, TAG_HEIGHT_M)),
        sensors=SensorErrors(wheels=WheelErrors(rate=10.0), imu=ImuErrors(rate=10.0)),
    )


def _along(places: Array) -> tuple[Array, Array]:
    """Return how far along the square each place is, and how far from it [m]."""
    arc, found = 0.0, []
    for x, y in places:
        arc, away = SQUARE.project(float(x), float(y), arc - _BACK_M, arc + _ON_M)
        found.append((arc, away))
    arcs, distances = np.array(found).T
    return arcs, distances


_COLOURS = ('#0072B2', '#E69F00')


def draw(figure: Any, runs: dict[str, Tracked]) -> None:
    """Draw the first seed's ways near one corner, and their errors along the square."""
    left, right = figure.subplots(1, 2, width_ratios=(1, 2))
    left.plot(*SQUARE.points.T, color='#BBBBBB', linewidth=3.0, label='track')
    for (name, run), colour in zip(runs.items(), _COLOURS, strict=True):
        left.plot(*run.truth.T, color=colour, linewidth=1.0, label=name)
        arcs, _ = _along(run.truth)
        right.plot(arcs, run.track_m, color=colour, linewidth=1.0, label=name)
        right.plot(arcs, np.abs(run.across_m), ':', color=colour, linewidth=0.7)
    left.set_xlim(2.5, 4.5)
    left.set_ylim(10.5, 12.5)
    left.set_aspect('equal')
    left.set_xlabel('x [m]')
    left.set_ylabel('y [m]')
    left.set_title('One corner', loc='left')
    left.legend(loc='lower right')
    right.set_xlabel('along the square [m]')
    right.set_ylabel('from the track [m]')
    right.set_title('True error; dotted: localisation across the track', loc='left')
    right.legend(loc='upper right')
