"""Sun et al. 2019: a square in a room of 15 m, with few people and with many (table 1).

The rows of the sensors alone: IMU-aided odometry, and UWB by the paper's own chain (two-way
ranging, a constant off ranges of poor signal, three circles). Then, on the same drives, the
paper's filters and ours. Many seeds are run at once as arrays; `drive_of`, `fixes_of` and
`fused_of` take one seed through the code of the nodes, for comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import TablerunnerError
from tablerunner.estimation import LocalizerConfig
from tablerunner.evaluation.kept_errors import ErrorKeeper, KeptErrors
from tablerunner.experiments.belief import estimated
from tablerunner.experiments.drive import Drive, drive_route, uwb_fixes
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.fleet_drive import drive_fleet, estimated_fleet, ranged, reckoned
from tablerunner.experiments.seeds import run_seeds
from tablerunner.odometry import OdometerConfig
from tablerunner.scenario import (
    AnchorPlace,
    ImuErrors,
    Person,
    RobotGeometry,
    Scenario,
    SensorErrors,
    UwbErrors,
    Wall,
    WheelErrors,
)
from tablerunner.simulation.fleet import FleetRecord
from tablerunner.simulation.streams import stream
from tablerunner.uwb import PositionerConfig, RangerConfig
from tablerunner.uwb.batch import fixes_of as fleet_fixes

Array = NDArray[np.float64]

SIDE_M, ANCHOR_HEIGHT_M, TAG_HEIGHT_M = 15.0, 2.25, 1.1
ROUTE = ((3.0, 12.0), (12.0, 12.0), (12.0, 3.0), (3.0, 3.0))
START = (3.0, 3.0, np.pi / 2)
STILL_S = 5.0
"""Standing before the drive, while the gyro's bias is learned."""

PEOPLE = {'I': 3, 'II': 12}
"""Fewer than 4, who keep to the walls; more than 10, who are everywhere."""

PAPER_M: dict[str, dict[str, tuple[float, ...]]] = {
    'I': {'odometry': (0.631, 0.799, 0.633), 'uwb': (0.596, 0.584, 0.626)},
    'II': {'odometry': (0.594, 0.613), 'uwb': (1.035, 0.823)},
}
"""Table 1: maximum error of each run."""

PAPER_EKF_M = {'I': (0.162, 0.142, 0.147), 'II': (0.155, 0.150)}
"""Table 1: the same of the paper's fused estimate."""

UWB_BOUND = {'I': Bound(0.55, 0.65), 'II': Bound(0.8, 1.1)}
ODOMETRY_BOUND = Bound(0.59, 0.80)
PAPER_FILTERS = ('kf', 'ekf_cv')
PAPER_FILTER_BOUND = Bound(0.75 * 0.142, 1.25 * 0.162)
OUR_FILTERS = ('ekf',)
OUR_BOUND = {'I': Bound(high=0.08, of='median'), 'II': Bound(high=0.10, of='median')}

UWB_ERRORS = UwbErrors(
    rate=10.0,
    range_std=0.103,
    bias_std=0.0,
    scale_std=0.0,
    person_excess=(0.0, 0.57),
    nlos_hold=0.3,
    nlos_std=0.1,
)
WHEEL_ERRORS = WheelErrors(rate=10.0, radius_scale_std=0.004)
IMU_ERRORS = ImuErrors(rate=10.0, gyro_std=0.002, gyro_bias_std=0.0015, gyro_bias_walk=0.00005)
RADIUS_FACTOR = 1.05
"""By how much odometry takes the wheels for too large: one robot, so the same in every run."""

NLOS_OFFSET_M = 0.2
"""Sun (37): what is taken off a range of poor signal."""

POSITIONER = PositionerConfig(solver='three_circle', tag_height=TAG_HEIGHT_M)

_RINGS = ((4.2, 10.8, 4.2, 10.8), (0.6, 1.9, 0.6, 14.4), (13.1, 14.4, 0.6, 14.4))


AT_ONCE = 500
"""Seeds that are run as one batch: more would be no faster, and take more memory."""


@dataclass(frozen=True)
class SunRuns:
    """One situation for some seeds.

    Attributes
    ----------
    odometry, uwb : KeptErrors
    fused : dict of str to KeptErrors
        By estimator.
    truth, fixes : ndarray, shape (k, 2), (m, 2)
        Of the first seed, for the picture [m].
    """

    odometry: KeptErrors
    uwb: KeptErrors
    fused: dict[str, KeptErrors]
    truth: Array
    fixes: Array


def run_sun2019(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run both situations for many seeds."""
    parts = [tuple(seeds[first : first + AT_ONCE]) for first in range(0, len(seeds), AT_ONCE)]
    # The longer work first, so that no core is left alone with it.
    tasks = [(situation, part) for situation in reversed(PAPER_M) for part in parts]
    found = run_seeds(_run_task, tasks, progress)
    runs = {
        situation: [some for task, some in zip(tasks, found, strict=True) if task[0] == situation]
        for situation in PAPER_M
    }
    rows = []
    for situation, paper in PAPER_M.items():
        for name, source, bound in (
            ('IMU-aided odometry', 'odometry', ODOMETRY_BOUND),
            ('UWB', 'uwb', UWB_BOUND[situation]),
        ):
            rows.append(
                Row(
                    f'situation {situation}, {name}, max',
                    'm',
                    _largest([getattr(some, source) for some in runs[situation]]),
                    round(float(np.mean(paper[source])), 3),
                    raw=True,
                    bound=bound,
                )
            )
    for situation in PAPER_M:
        for name in (*PAPER_FILTERS, *OUR_FILTERS):
            rows.append(_fused_row(runs[situation], situation, name))
    return Outcome(
        'sun2019',
        'Sun et al. 2019, table 1: largest error on the square',
        tuple(seeds),
        tuple(rows),
        partial(draw, runs=runs['I'][0]),
        {
            'range deviation [m]': UWB_ERRORS.range_std,
            'excess behind a person [m]': list(UWB_ERRORS.person_excess),
            'constant off a blocked range [m]': NLOS_OFFSET_M,
            'people': PEOPLE,
            'wheel radius that odometry is told, over the true one': RADIUS_FACTOR,
        },
        (
            'Bounds are on the mean over seeds of the largest error of a run (ekf: on the '
            'median); the paper has three runs of situation I and two of II.',
            'UWB is the chain of the paper: double-sided ranging, a constant off ranges of poor '
            'signal (37), slant to plane, three circles (16-17).',
            'Chosen to match the raw rows, the same for all seeds: noise of ranges, excess behind '
            'people, how many people, noise and bias of the gyro, error of the wheel radius (one '
            'robot drove all runs: five percent, known to no filter).',
            'kf and ekf_cv run on the Q and R that the paper prints; the offset from which kf '
            'disbelieves a position (0.4 m) and the velocity noise of ekf_cv are ours, the same '
            'for both situations. ekf runs on its defaults.',
            'People walk off the track, as in the paper: few of them along the walls, many also '
            'inside the square.',
        ),
    )


def _largest(parts: Sequence[KeptErrors]) -> Spread:
    return Spread.of(np.concatenate([part.largest for part in parts]))


def _fused_row(runs: Sequence[SunRuns], situation: str, name: str) -> Row:
    ours = name in OUR_FILTERS
    return Row(
        f'situation {situation}, {name}, max',
        'm',
        _largest([some.fused[name] for some in runs]),
        None if ours else round(float(np.mean(PAPER_EKF_M[situation])), 3),
        bound=OUR_BOUND[situation] if ours else PAPER_FILTER_BOUND,
    )


def _run_task(task: tuple[str, tuple[int, ...]]) -> SunRuns:
    situation, seeds = task
    return run_situation(situation, seeds)


def run_situation(situation: str, seeds: Sequence[int], keep: str = 'summary') -> SunRuns:
    """Run one situation for many seeds at once.

    Parameters
    ----------
    situation : str
        ``I`` or ``II``.
    seeds : sequence of int
    keep : str
        How much to keep of the errors; see `evaluation.kept_errors`.

    Raises
    ------
    ConfigError
        `keep` is not known, or there are no seeds.
    TablerunnerError
        Somebody was touched, which a fleet does not feel.
    """
    record = fleet_of(seeds, situation)
    for seed, free_m in zip(seeds, record.closest_m, strict=True):
        if free_m <= 0.0:
            raise TablerunnerError(f'sun2019, seed {seed}: somebody stands in the way')
    track = reckoned(record, odometer())
    truth, counts = record.truth[:, :2], record.counts
    keeper = ErrorKeeper(keep, truth, counts)
    for index, places in enumerate(track.laid_on(START)):
        keeper.add(index, places.T)
    odometry = keeper.result()
    fused = {}
    for name in (*PAPER_FILTERS, *OUR_FILTERS):
        offset = _offset_of(name)
        keeper = ErrorKeeper(keep, truth, counts)
        beliefs = estimated_fleet(
            track, ranged(record, ranger(offset)), ranger(offset), localizer(name)
        )
        for index, believed in beliefs:
            keeper.add(index, believed)
        fused[name] = keeper.result()
    uwb, fixes = _uwb_errors(record, keep)
    return SunRuns(odometry, uwb, fused, truth[counts[:, 0], :, 0], fixes)


def _uwb_errors(record: FleetRecord, keep: str) -> tuple[KeptErrors, Array]:
    """Return the errors of all fixes, and the fixes of the first run."""
    config = ranger(NLOS_OFFSET_M)
    fixes = fleet_fixes(POSITIONER, config.anchors, ranged(record, config), record.end)
    # Each run's fixes come at its own times: its first in the first row, and so on.
    order = np.argsort(fixes.runs, kind='stable')
    run = fixes.runs[order]
    number = np.arange(len(run)) - np.searchsorted(run, run)
    shape = (int(number.max()) + 1, record.runs)
    stamps = np.zeros(shape, dtype=np.int64)
    places = np.full((shape[0], 2, shape[1]), np.nan)
    stamps[number, run] = fixes.stamps[order]
    places[number, :, run] = fixes.place[order]
    keeper = ErrorKeeper(keep, record.truth_at(stamps), stamps > 0)
    for index, some in enumerate(places):
        keeper.add(index, some.T)
    return keeper.result(), fixes.place[fixes.runs == 0]


def odometer() -> OdometerConfig:
    """Return the settings of odometry: the wheels are smaller than it is told."""
    config = OdometerConfig()
    radius = RobotGeometry().wheel_radius * RADIUS_FACTOR
    return config.replace(wheels=config.wheels.replace(wheel_radius=radius))


def localizer(name: str) -> LocalizerConfig:
    """Return the settings of an estimator, begun at the known start of the paper."""
    return LocalizerConfig(
        estimator=name,
        tag_position=(0.0, 0.0, TAG_HEIGHT_M),
        initial_pose=START,
        initial_pose_std=(0.03, 0.03, 0.02),
        positioner=POSITIONER,
    )


def _offset_of(name: str) -> float:
    # The constant (37) belongs to the paper's chain; ours weighs blocked ranges by itself.
    return NLOS_OFFSET_M if name in PAPER_FILTERS else 0.0


def fused_of(drive: Drive, name: str) -> tuple[NDArray[np.int64], Array]:
    """Return stamps and places of an estimator, by the code that the nodes run."""
    return estimated(drive, ranger(_offset_of(name)), odometer(), localizer(name))


def ranger(nlos_offset: float) -> RangerConfig:
    """Return the settings of the driver."""
    anchors = scenario_of(0, 'I').anchors
    return RangerConfig(
        anchor_ids=tuple(anchor.id for anchor in anchors),
        anchor_positions=tuple(value for anchor in anchors for value in anchor.position),
        nlos_offset=nlos_offset,
    )


def drive_of(seed: int, situation: str) -> Drive:
    """Return the drive of one robot; its sensors are the same in every experiment that asks."""
    run = _run_of(seed, situation)
    return drive_route(scenario_of(run, situation), run, ROUTE, still_s=STILL_S)


def fleet_of(seeds: Sequence[int], situation: str) -> FleetRecord:
    """Return the drives of many seeds at once: other noise than `drive_of`, of the same kind."""
    runs = [_run_of(seed, situation) for seed in seeds]
    people = [_people_in(situation, run) for run in runs]
    return drive_fleet(scenario_of(0, situation), runs, ROUTE, still_s=STILL_S, people=people)


def _run_of(seed: int, situation: str) -> int:
    # Two situations are two runs of the same robot, not the same run twice.
    return len(PEOPLE) * seed + list(PEOPLE).index(situation)


def scenario_of(seed: int, situation: str) -> Scenario:
    """Return the room with its people, whose ways are drawn from the seed."""
    corners = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M))
    return Scenario(
        name=f'sun2019 {situation}',
        walls=(Wall(corners, 'outer wall', closed=True),),
        anchors=tuple(
            AnchorPlace(f'A{index}', (*corner, ANCHOR_HEIGHT_M))
            for index, corner in enumerate(corners)
        ),
        people=_people_in(situation, seed),
        start=START,
        robot=replace(RobotGeometry(), tag_position=(0.0, 0.0, TAG_HEIGHT_M), ultrasonics=()),
        sensors=SensorErrors(uwb=UWB_ERRORS, wheels=WHEEL_ERRORS, imu=IMU_ERRORS),
    )


def people_of(seed: int, count: int, by_the_walls: bool = False) -> tuple[Person, ...]:
    """Return people who walk about between the square and the walls, or also inside the square."""
    rng = stream(seed, 'people of sun2019')
    chances = (0.0, 0.5, 0.5) if by_the_walls else (0.5, 0.25, 0.25)
    found = []
    for index in range(count):
        left, right, low, high = _RINGS[int(rng.choice(3, p=chances))]
        route = tuple(
            (float(x), float(y))
            for x, y in zip(rng.uniform(left, right, 4), rng.uniform(low, high, 4), strict=True)
        )
        found.append(Person(f'person {index}', route, loop=True))
    return tuple(found)


def _people_in(situation: str, run: int) -> tuple[Person, ...]:
    return people_of(run, PEOPLE[situation], by_the_walls=situation == 'I')


def fixes_of(drive: Drive) -> tuple[NDArray[np.int64], Array]:
    """Return stamps and places of the UWB row."""
    return uwb_fixes(drive, ranger(NLOS_OFFSET_M), POSITIONER)


def draw(figure: Any, runs: SunRuns) -> None:
    """Draw the first seed's square and its UWB fixes."""
    axes = figure.add_subplot()
    axes.plot(*runs.fixes.T, '.', color='#E69F00', markersize=2.5, label='UWB')
    axes.plot(*runs.truth.T, color='#000000', linewidth=1.0, label='truth')
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')
    axes.set_title('Sun et al. 2019, situation I', loc='left')
    axes.legend(loc='center')
