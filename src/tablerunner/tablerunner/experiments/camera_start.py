"""Found by the ceiling camera alone: from nowhere, and again after being carried off.

The drives are those of `global_start`, without anchors. Poses are drawn, not seen in pictures,
with the errors that the camera run shows; some are false, anywhere in the room. Settings are the
shipped ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.estimation import Localizer
from tablerunner.experiments.belief import Sensed, sense
from tablerunner.experiments.drive import Drive
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.global_start import (
    NEAR_M,
    NEAR_RAD,
    Run,
    follow,
    judge,
    part_of,
    room_of,
)
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PoseSample, nanoseconds
from tablerunner.vision.locator import POSE_SOURCE

FAR_M = 0.5
"""Within how much driving the pose is to be found."""

ESTIMATED = ('ekf', 'pf_uiekf')
PERIOD_S = 0.1
FALSE_SHARE = 0.05
"""Share of poses that are of something else, anywhere in the room."""

CALIBRATION_STD_M, PLACE_STD_M, HEADING_STD_RAD = 0.0064, 0.001, 0.002
"""What places are off by, in each direction, all over a seed and in each picture; headings."""

TOLD = np.diag(np.square([0.005, 0.005, 0.0105]))
"""The covariance that the camera gives with them."""


def run_camera_start(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run all estimators for many seeds."""
    runs = run_seeds(one_run, seeds, progress)
    rows = []
    for name in ESTIMATED:
        for part, words in enumerate(('from anywhere', 'carried off')):
            found = [run[name][part] for run in runs]
            known = [item for item in found if math.isfinite(item.driven)]
            share = 100.0 * sum(item.driven <= FAR_M for item in found) / len(found)
            head = f'{name}, {words}'
            if part == 0:
                bound = Bound(low=98.0)
                rows.append(
                    Row(f'{head}, found within 0.5 m', '%', Spread.of([share]), bound=bound)
                )
            else:
                again = 100.0 * len(known) / len(found)
                rows.append(Row(f'{head}, found', '%', Spread.of([again])))
            if known:
                rows.append(Row(f'{head}, driven', 'm', Spread.of([i.driven for i in known])))
            near = [item for item in found if math.isfinite(item.place)]
            if part == 0 and near:
                headings = [math.degrees(item.heading) for item in near]
                rows += [
                    Row(f'{head}, error after 0.5 m', 'm', Spread.of([i.place for i in near])),
                    Row(f'{head}, heading error after 0.5 m', 'deg', Spread.of(headings)),
                ]
    return Outcome(
        'camera_start',
        'From anywhere in 15 m x 15 m, and carried off: the camera alone, no anchors',
        tuple(seeds),
        tuple(rows),
        partial(draw, runs=runs),
        {
            'near [m]': NEAR_M,
            'near [deg]': math.degrees(NEAR_RAD),
            'between poses [s]': PERIOD_S,
            'false poses [1]': FALSE_SHARE,
            'calibration, each direction [m]': CALIBRATION_STD_M,
            'place of a picture, each direction [m]': PLACE_STD_M,
            'heading [rad]': HEADING_STD_RAD,
        },
        (
            'Found: as in global_start.',
            'Poses are drawn with the errors of the camera run, not seen in pictures; the camera '
            'is taken to see all of the room.',
        ),
    )


def one_run(seed: int, names: Sequence[str] = ESTIMATED) -> Run:
    """Return how each estimator finds the pose on the drive of one seed."""
    room = room_of()
    config = ReplayConfig.from_scenario(room)
    parts = [part_of(room, seed, index) for index in range(2)]
    rng = np.random.default_rng([seed, 6])
    calibration = rng.normal(0.0, CALIBRATION_STD_M, 2)
    sensed = [
        in_time(sense(part, config.ranger, config.odometer), poses_of(part, calibration, rng))
        for part in parts
    ]
    result = {}
    for name in names:
        fusing = Localizer(replace(config.localizer, estimator=name))
        after, place, found = 0, Pose2(), []
        for part, samples in zip(parts, sensed, strict=True):
            beliefs, place, last = follow(fusing, samples, after, place)
            found.append(judge(part, beliefs, after, FAR_M))
            after = last + nanoseconds(0.1)
        result[name] = (found[0], found[1])
    return result


def poses_of(
    part: Drive, calibration: Sequence[float] | np.ndarray[Any, Any], rng: np.random.Generator
) -> list[PoseSample]:
    """Return what the camera says of a drive; `calibration` is what all places are off by [m]."""
    first, last = int(part.stamps[0]), int(part.stamps[-1])
    # Exposures fall anywhere between two odometry stamps.
    begin = first + int(rng.integers(nanoseconds(PERIOD_S)))
    turned = np.unwrap(part.poses[:, 2])
    poses = []
    for stamp in range(begin, last, nanoseconds(PERIOD_S)):
        x, y = part.place_at(np.array([stamp]))[0]
        noise = rng.normal(0.0, (PLACE_STD_M, PLACE_STD_M, HEADING_STD_RAD))
        heading = float(np.interp(stamp, part.stamps, turned)) + noise[2]
        pose = Pose2(
            float(x + calibration[0] + noise[0]),
            float(y + calibration[1] + noise[1]),
            wrap(heading),
        )
        elsewhere = rng.uniform((0.0, 0.0, -math.pi), (15.0, 15.0, math.pi))
        if rng.random() < FALSE_SHARE:
            pose = Pose2(*(float(value) for value in elsewhere))
        poses.append(PoseSample(stamp, pose, TOLD, POSE_SOURCE))
    return poses


def in_time(
    sensed: Sequence[Sensed], poses: Sequence[PoseSample]
) -> tuple[Sensed | PoseSample, ...]:
    """Return odometry, ranges and poses in order of their stamps."""
    return tuple(sorted((*sensed, *poses), key=lambda sample: sample.stamp))


def draw(figure: Any, runs: Sequence[Run]) -> None:
    """Draw which share of the drives had found the pose over the way driven."""
    figure.set_size_inches(9.0, 4.5)
    for axes, part, words in zip(
        figure.subplots(1, 2, sharey=True), (0, 1), ('from anywhere', 'carried off'), strict=True
    ):
        # One may lie on the other.
        for name, line in zip(ESTIMATED, ('-', '--'), strict=True):
            driven = np.sort([run[name][part].driven for run in runs])
            share = 100.0 * np.arange(1, len(driven) + 1) / len(driven)
            axes.step(driven, share, where='post', label=name, linestyle=line)
        axes.set_xlim(0.0, 2.0)
        axes.set_ylim(0.0, 101.0)
        axes.set_xlabel('driven [m]')
        axes.set_title(words, loc='left')
    figure.axes[0].axvline(FAR_M, color='0.8', linewidth=1.0, zorder=0)
    figure.axes[0].set_ylabel('drives that found the pose [%]')
    figure.axes[0].legend()
