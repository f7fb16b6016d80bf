"""Lv and Jiang's drives (figures 10 and 11), and contour following out of traps (4.C).

The paper shows the trajectories only as pictures, so there are no published figures. Each drive is
compared with the shortest way of the hull, by the planner of `tablerunner.control`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tablerunner.control.contour import ContourConfig, Mode
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.experiments.trap_drive import TrapDrive, drive_to
from tablerunner.experiments.trap_room import CLOSED, TRAPS, TrapRoom, make_trap_room

LEAST_ROOMS = 20
"""Trap rooms that are driven at least, however few the seeds are."""

_STRIDE = 100_000  # seeds of further rooms, when there are few
_OLDER = ContourConfig(leave='nearer')


@dataclass(frozen=True, eq=False)
class Trial:
    """One room, the drive by the improved method and, in a trap room, by the older one."""

    room: TrapRoom
    improved: TrapDrive
    older: TrapDrive | None = None

    @property
    def ratio(self) -> float:
        """Way driven, and what is left to the target, over the shortest way; NaN: none."""
        shortest = self.room.shortest
        if shortest is None:
            return math.nan
        left = math.dist(self.improved.track[-1], self.room.target)
        return (self.improved.way_m + left) / shortest.length


@dataclass(frozen=True, eq=False)
class LvDrives:
    """All drives of one seed."""

    empty: Trial
    box: Trial
    traps: tuple[Trial, ...]
    closed: tuple[Trial, ...]

    @property
    def gap_m(self) -> float:
        """Least true gap between the hull and anything, of all drives of the improved method."""
        trials = (self.empty, self.box, *self.traps, *self.closed)
        return min(trial.improved.gap_m for trial in trials)

    @property
    def against_older(self) -> float:
        """Ways of the improved method over those of the older, where both arrive."""
        both = [
            (trial.improved.way_m, trial.older.way_m)
            for trial in self.traps
            if trial.older is not None and trial.older.arrived and trial.improved.arrived
        ]
        return sum(a for a, _ in both) / sum(b for _, b in both) if both else math.nan


def one_seed(seed: int, rooms: int = 1) -> LvDrives:
    """Drive through the rooms of a seed, `rooms` of each kind of trap."""
    traps = [
        make_trap_room(kind, seed + number * _STRIDE) for number in range(rooms) for kind in TRAPS
    ]
    return LvDrives(
        _try(make_trap_room('empty', seed), seed),
        _try(make_trap_room('box', seed), seed),
        tuple(_try(room, seed, True) for room in traps),
        tuple(_try(make_trap_room(kind, seed), seed) for kind in CLOSED),
    )


def _try(room: TrapRoom, seed: int, with_older: bool = False) -> Trial:
    improved = drive_to(room.scenario, room.target, seed)
    older = drive_to(room.scenario, room.target, seed, _OLDER) if with_older else None
    return Trial(room, improved, older)


def run_trajectories(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Drive for many seeds, in at least `LEAST_ROOMS` trap rooms."""
    each = math.ceil(LEAST_ROOMS / (len(TRAPS) * max(len(seeds), 1)))
    runs = run_seeds(partial(one_seed, rooms=each), seeds, progress)
    arrived = [float(np.mean([trial.improved.arrived for trial in run.traps])) for run in runs]
    older = [
        float(np.mean([trial.older is not None and trial.older.arrived for trial in run.traps]))
        for run in runs
    ]
    reported = [
        float(np.mean([trial.improved.mode is Mode.UNREACHABLE for trial in run.closed]))
        for run in runs
    ]
    ratios = [float(np.mean([trial.ratio for trial in run.traps])) for run in runs]
    against = [run.against_older for run in runs if math.isfinite(run.against_older)]
    rows = (
        _row('no obstacle, path / shortest', [run.empty.ratio for run in runs], Bound(high=1.05)),
        _row('one obstacle, path / shortest', [run.box.ratio for run in runs], Bound(high=1.25)),
        _row('trap rooms, arrived', arrived, Bound(low=1.0)),
        _row('trap rooms, arrived by the older method', older),
        _row('trap rooms, path / shortest', ratios),
        _row('path improved / older', against or [math.inf], Bound(high=1.0)),
        _row('closed rooms, reported unreachable', reported, Bound(low=1.0)),
        Row('least gap to anything', 'm', Spread.of([run.gap_m for run in runs])),
    )
    count = len(TRAPS) * each * len(seeds)
    return Outcome(
        'lv',
        'Lv and Jiang, figures 10 and 11: trajectories',
        tuple(seeds),
        rows,
        partial(draw_trajectories, run=runs[0]),
        {'trap rooms': count, 'kinds of traps': list(TRAPS), 'pose': 'true'},
        (
            (
                f'Trajectories: {count} trap rooms; wheels and echoes of the simulator with their '
                'errors, the true pose. The shortest way knows the room, the robot does not.'
            ),
            (
                'The older method leaves a contour nearer the target than where it began, and '
                'does not look; ways are compared where both arrive.'
            ),
        ),
    )


def _row(name: str, values: Sequence[float], bound: Bound | None = None) -> Row:
    return Row(name, '1', Spread.of(values), bound=bound)


def draw_trajectories(figure: Any, run: LvDrives) -> None:
    """Draw figures 10 and 11 and a trap room of each kind, with both methods."""
    trials = [('without obstacle', run.empty), ('one obstacle', run.box)]
    trials += [(f'{trial.room.kind} trap', trial) for trial in run.traps[: len(TRAPS)]]
    everything = figure.subplots(2, 3, sharex=True, sharey=True)
    for axes, (title, trial) in zip(everything.ravel(), trials, strict=False):
        for segment in trial.room.scenario.obstacle_segments():
            axes.plot(segment[:, 0], segment[:, 1], color='#4A4A4A', linewidth=1.2)
        shortest = trial.room.shortest
        if shortest is not None:
            axes.plot(*shortest.points.T, color='#6B6B6B', linestyle=':', label='shortest')
        if trial.older is not None:
            axes.plot(*trial.older.track.T, color='#E69F00', linewidth=2.4, label='older')
        axes.plot(*trial.improved.track.T, color='#0072B2', label='improved')
        axes.plot(*trial.room.target, marker='*', color='#D55E00', linestyle='')
        axes.set_title(title, loc='left')
        axes.set_aspect('equal')
        axes.set_xticks([0, 5, 10])
        axes.set_yticks([0, 5, 10])
    handles, labels = axes.get_legend_handles_labels()
    everything[0, 0].legend(handles, labels, loc='lower right')
    for axes in everything[1]:
        axes.set_xlabel('x [m]')
    for axes in everything[:, 0]:
        axes.set_ylabel('y [m]')
