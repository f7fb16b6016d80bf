"""Particle filters that know nothing at the start, and again after they were carried off.

Every seed is a drive through the room of 15 m x 15 m of Sun et al. from a random pose along random
legs; then somebody carries the robot to another random pose, from where it drives on, odometry
knowing nothing of it. UWB only. Settings are the shipped ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.estimation import Localizer
from tablerunner.estimation.registry import ESTIMATORS, STARTS_ANYWHERE
from tablerunner.experiments.belief import Sensed, sense
from tablerunner.experiments.drive import Drive, Route, drive_route
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import AnchorPlace, RobotGeometry, Scenario, SensorErrors, Wall
from tablerunner.types import Matrix, RangeSample

FAR_M = 5.0
"""Within how much driving the pose is to be found."""
NEAR_M, NEAR_RAD = 0.3, math.radians(10.0)
"""How near the truth a pose is that counts as found."""

ESTIMATED = ('ekf', *(name for name in ESTIMATORS if name in STARTS_ANYWHERE))
"""The `ekf` begins where the search for a start ends: what particles are compared with."""

_LONGER_M = 6.0  # each part of a drive: a little more than what is judged
_WALL_M = 1.0
_SPEED_M_S = 0.5


@dataclass(frozen=True)
class Found:
    """How a part of a drive went for one estimator.

    Attributes
    ----------
    driven : float
        Until a pose near the truth was believed, for good [m]; infinite if it never was.
    place, heading : float
        Errors after `FAR_M` [m, rad]; NaN where no pose was believed.
    """

    driven: float
    place: float
    heading: float

    @property
    def in_time(self) -> bool:
        """Whether it was found within `FAR_M`."""
        return self.driven <= FAR_M


Run = dict[str, tuple[Found, Found]]
"""Of each estimator, from nowhere and after being carried off."""


def run_global_start(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run all estimators for many seeds."""
    runs = run_seeds(one_run, seeds, progress)
    rows = []
    for name in ESTIMATED:
        for part, words in enumerate(('from anywhere', 'carried off')):
            found = [run[name][part] for run in runs]
            share = 100.0 * sum(item.in_time for item in found) / len(found)
            bound = Bound(low=98.0) if part == 0 and name != 'ekf' else None
            head = f'{name}, {words}'
            rows.append(Row(f'{head}, found within 5 m', '%', Spread.of([share]), bound=bound))
            known = [item for item in found if item.in_time]
            if known:
                rows += [
                    Row(f'{head}, driven', 'm', Spread.of([item.driven for item in known])),
                    Row(f'{head}, error after 5 m', 'm', Spread.of([i.place for i in known])),
                    Row(
                        f'{head}, heading error after 5 m',
                        'deg',
                        Spread.of([math.degrees(item.heading) for item in known]),
                    ),
                ]
    return Outcome(
        'global_start',
        'From anywhere in 15 m x 15 m, and carried off: UWB only',
        tuple(seeds),
        tuple(rows),
        partial(draw, runs=runs),
        {'near [m]': NEAR_M, 'near [deg]': math.degrees(NEAR_RAD), 'speed [m/s]': _SPEED_M_S},
        (
            (
                'Found: a pose is believed (localiser tracking) that is near the truth, and '
                'stays so to the end of the part.'
            ),
            'driven and errors: of those that were found in time.',
        ),
    )


def one_run(seed: int, names: Sequence[str] = ESTIMATED, carried_off: bool = True) -> Run:
    """Return how each estimator finds the pose on the drive of one seed."""
    room = room_of()
    config = ReplayConfig.from_scenario(room)
    parts = [part_of(room, seed, index) for index in range(2 if carried_off else 1)]
    sensed = [sense(part, config.ranger, config.odometer) for part in parts]
    result = {}
    for name in names:
        fusing = Localizer(replace(config.localizer, estimator=name), config.ranger.anchors)
        after, place, found = 0, Pose2(), []
        for part, samples in zip(parts, sensed, strict=True):
            beliefs, place, last = _follow(fusing, samples, after, place)
            found.append(_judge(part, beliefs, after))
            after = last + 100_000_000
        result[name] = (found[0], found[-1])
    return result


def room_of() -> Scenario:
    """Return the empty room of 15 m x 15 m, four anchors in its corners."""
    side = 15.0
    corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
    errors = SensorErrors()
    return Scenario(
        name='global_start',
        walls=(Wall(corners, 'outer wall', closed=True),),
        anchors=tuple(
            AnchorPlace(f'A{index}', (*corner, 2.25)) for index, corner in enumerate(corners)
        ),
        start=(3.0, 3.0, 0.0),
        robot=replace(RobotGeometry(), tag_position=(0.0, 0.0, 1.1), ultrasonics=()),
        sensors=replace(
            errors, wheels=replace(errors.wheels, rate=10.0), imu=replace(errors.imu, rate=10.0)
        ),
    )


def part_of(room: Scenario, seed: int, index: int) -> Drive:
    """Return a drive from a random pose along random legs."""
    rng = np.random.default_rng([seed, index])
    low, high = _WALL_M, 15.0 - _WALL_M
    x, y = rng.uniform(low, high, 2)
    start = (float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
    legs: list[tuple[float, float]] = []
    length, at = 0.0, (start[0], start[1])
    while length < _LONGER_M:
        to = (float(rng.uniform(low, high)), float(rng.uniform(low, high)))
        share = min(1.0, (_LONGER_M + 0.2 - length) / math.dist(at, to))
        to = (at[0] + share * (to[0] - at[0]), at[1] + share * (to[1] - at[1]))
        length += math.dist(at, to)
        legs.append(to)
        at = to
    route: Route = tuple(legs)
    return drive_route(room.replace(start=start), seed + 1_000_003 * index, route, _SPEED_M_S)


Believed = tuple[int, Matrix | None]
"""A stamp of the drive [ns], and the pose that was believed then, if any."""


def _follow(
    fusing: Localizer, samples: Sequence[Sensed], after: int, place: Pose2
) -> tuple[list[Believed], Pose2, int]:
    """Give samples to the localiser, later by `after`, odometry going on from `place`.

    Ranges wait for the odometry that follows them: a localiser puts them in their place, to the
    last bit, and has half the work.
    """
    beliefs: list[Believed] = []
    newest, last = place, after
    waiting: list[RangeSample] = []
    for sample in samples:
        stamp = sample.stamp + after
        last = max(last, stamp)
        if isinstance(sample, RangeSample):
            waiting.append(replace(sample, stamp=stamp))
            continue
        newest = place @ sample.pose
        fusing.add_odometry(replace(sample, stamp=stamp, pose=newest))
        for held in waiting:
            fusing.add_range(held)
        waiting.clear()
        estimate = fusing.estimate
        beliefs.append((stamp, None if estimate is None else estimate.mean[:3]))
    return beliefs, newest, last


def _judge(part: Drive, beliefs: Sequence[Believed], after: int) -> Found:
    steps = np.linalg.norm(np.diff(part.poses[:, :2], axis=0), axis=1)
    driven_at = np.concatenate([[0.0], np.cumsum(steps)])
    turned = np.unwrap(part.poses[:, 2])
    found, place, heading = math.inf, math.nan, math.nan
    for stamp, pose in beliefs:
        at = stamp - after
        driven = float(np.interp(at, part.stamps, driven_at))
        off, turn = math.inf, math.inf
        if pose is not None:
            true = part.place_at(np.array([at]))[0]
            off = math.dist(pose[:2], true)
            turn = abs(wrap(float(pose[2] - np.interp(at, part.stamps, turned))))
        if off > NEAR_M or turn > NEAR_RAD:
            found = math.inf
        elif math.isinf(found):
            found = driven
        if driven <= FAR_M:
            place, heading = off, turn
    return Found(found, place, heading)


def draw(figure: Any, runs: Sequence[Run]) -> None:
    """Draw which share of the drives had found the pose over the way driven."""
    figure.set_size_inches(9.0, 4.5)
    for axes, part, words in zip(
        figure.subplots(1, 2, sharey=True), (0, 1), ('from anywhere', 'carried off'), strict=True
    ):
        for name in ESTIMATED:
            driven = np.sort([run[name][part].driven for run in runs])
            share = 100.0 * np.arange(1, len(driven) + 1) / len(driven)
            axes.step(driven, share, where='post', label=name)
        axes.axvline(FAR_M, color='0.8', linewidth=1.0, zorder=0)
        axes.set_xlim(0.0, _LONGER_M)
        axes.set_ylim(0.0, 101.0)
        axes.set_xlabel('driven [m]')
        axes.set_title(words, loc='left')
    figure.axes[0].set_ylabel('drives that found the pose [%]')
    figure.axes[0].legend()
