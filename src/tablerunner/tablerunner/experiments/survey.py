"""Surveys of anchors and calibrations of wheels on simulated drives, against what is true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.evaluation.consistency import chi_square_bounds
from tablerunner.evaluation.plots.survey import draw_survey
from tablerunner.experiments import sun2019
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.fleet_drive import drive_fleet, ranged, reckoned
from tablerunner.experiments.seeds import run_seeds
from tablerunner.odometry import OdometerConfig
from tablerunner.odometry.batch import gyro_angles
from tablerunner.scenario import AnchorPlace, RobotGeometry, Scenario, SensorErrors, WheelErrors
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.streams import stream
from tablerunner.survey.record import RangeTable, Survey, SurveyConfig, SurveyData
from tablerunner.survey.survey import survey
from tablerunner.survey.track import Track, laid_on
from tablerunner.survey.wheel_motion import Sizes, WheelAngles
from tablerunner.survey.wheels import WheelConfig, WheelData, WheelFit, fit_wheels
from tablerunner.uwb import RangerConfig

Array = NDArray[np.float64]

ANCHORS = {
    'A0': (0.0, 0.0, 2.25),
    'A1': (15.0, 0.0, 2.25),
    'A2': (15.0, 15.0, 2.25),
    'A3': (0.0, 15.0, 2.25),
}
START = (3.0, 3.0, np.pi / 2)
ROUTE = ((3.0, 12.0), (12.0, 12.0), (12.0, 3.0), (3.0, 3.0), (6.0, 6.0))
"""Sun's square and a bit: 40 m."""

WINDING = ((3.0, 9.0), (9.0, 12.0), (12.0, 6.0), (6.0, 3.0), (6.0, 10.0), (10.0, 8.0), (7.0, 6.0))
"""Turns to both sides: 40 m."""

STILL_S = 5.0
PROTOTYPE = SensorErrors(
    uwb=sun2019.UWB_ERRORS, wheels=sun2019.WHEEL_ERRORS, imu=sun2019.IMU_ERRORS
)
"""The noise that matches Sun's prototype; its ranges are calibrated."""

WHEEL_ERRORS = WheelErrors(radius_scale_std=0.02, track_scale_std=0.04)
GIVEN = {name: ANCHORS[name][:2] for name in ('A0', 'A1')}
HEIGHTS = {name: place[2] for name, place in ANCHORS.items()}
CALIBRATED = SurveyConfig(bias_std_m=0.0, scale_std=0.0)

CASES: dict[str, tuple[SensorErrors, SurveyConfig]] = {
    'two anchors given': (PROTOTYPE, replace(CALIBRATED, fixed=GIVEN)),
    'start given': (PROTOTYPE, replace(CALIBRATED, start=START)),
    'uncalibrated, two anchors and heights given': (
        SensorErrors(),
        SurveyConfig(fixed=GIVEN, heights=HEIGHTS),
    ),
}
ASKED_RMS_M = 0.05
AT_ONCE = 10


@dataclass(frozen=True)
class Recorded:
    """What one simulated robot measured.

    Attributes
    ----------
    data : SurveyData
    wheels : WheelAngles
    sizes : Sizes
        The true ones.
    """

    data: SurveyData
    wheels: WheelAngles
    sizes: Sizes


def room_of(sensors: SensorErrors) -> Scenario:
    """Return Sun's room with these sensors."""
    return Scenario(
        'survey',
        anchors=tuple(AnchorPlace(name, place) for name, place in ANCHORS.items()),
        start=START,
        robot=RobotGeometry(ultrasonics=()),
        sensors=sensors,
    )


def recorded(
    sensors: SensorErrors,
    seeds: Sequence[int],
    route: tuple[tuple[float, float], ...] = ROUTE,
    odometer: OdometerConfig | None = None,
) -> list[Recorded]:
    """Return drives along a route, one for each seed."""
    room, odometry = room_of(sensors), odometer or OdometerConfig()
    record = drive_fleet(room, seeds, route, still_s=STILL_S)
    track = reckoned(record, odometry)
    gyro, _ = gyro_angles(odometry.gyro, record.stamps, record.imu_stamps, record.yaw_rate)
    ranger = RangerConfig(
        anchor_ids=tuple(ANCHORS),
        anchor_positions=tuple(v for place in ANCHORS.values() for v in place),
    )
    ranges = ranged(record, ranger)
    drives = []
    for run, seed in enumerate(seeds):
        end = int(record.counts[:, run].sum())
        poses = np.column_stack([track.place[:end, :, run], track.heading[:end, run]])
        clear = np.isfinite(ranges.range_m[:, run]) & ~(ranges.nlos_probability[:, run] > 0.5)
        table = RangeTable(
            tuple(ANCHORS),
            ranges.stamps[clear],
            ranges.anchor[clear].astype(np.intp),
            ranges.range_m[clear, run],
        )
        base = Drive(room.robot, sensors.wheels, room.start_pose, stream(seed, 'drive'))
        drives.append(
            Recorded(
                SurveyData(Track(track.stamps[:end], poses), table, room.robot.tag_position),
                WheelAngles(record.stamps[:end], record.wheels[:end, :, run], gyro[:end, run]),
                Sizes(base.left_radius_m, base.right_radius_m, base.track_m),
            )
        )
    return drives


def wheel_data(drive: Recorded) -> WheelData:
    """Return what calibrates the wheels of a drive."""
    robot, room = RobotGeometry(), room_of(SensorErrors())
    nominal = Sizes(robot.wheel_radius, robot.wheel_radius, robot.track)
    anchors = tuple(place.anchor for place in room.anchors)
    data = drive.data
    return WheelData(drive.wheels, data.track, data.ranges, anchors, data.tag_position, nominal)


@dataclass(frozen=True)
class Judged:
    """How far a survey is off.

    Attributes
    ----------
    rms, shape, height : float
        Over the floor, the same moved and turned onto the truth, and of the heights [m].
    nees : float
        For each dimension.
    dimensions : int
    """

    rms: float
    shape: float
    height: float
    nees: float
    dimensions: int


def judge(found: Survey) -> Judged:
    """Return how far a survey is off the true anchors."""
    true = np.array([ANCHORS[item.anchor_id] for item in found.anchors])
    error = found.positions - true
    laid, _ = laid_on(found.positions[:, :2], true[:, :2])
    free = np.flatnonzero(np.diag(found.covariance) > 0.0)
    block = found.covariance[np.ix_(free, free)]
    off = error.ravel()[free]
    return Judged(
        _rms(error[:, :2]),
        _rms(laid - true[:, :2]),
        float(np.sqrt(np.mean(error[:, 2] ** 2))),
        float(off @ np.linalg.solve(block, off)) / len(free),
        len(free),
    )


def judge_wheels(fit: WheelFit, true: Sizes) -> tuple[float, float, float, float]:
    """Return errors of mean radius, difference and track [%], and the NEES for each dimension."""
    error = fit.sizes.values - true.values
    radius = true.values[:2].mean()
    return (
        float(100.0 * error[:2].mean() / radius),
        float(100.0 * (error[1] - error[0]) / radius),
        float(100.0 * error[2] / true.track_m),
        float(error @ np.linalg.solve(fit.covariance, error)) / 3.0,
    )


def run_survey(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Survey and calibrate on drives of 40 m, one for each seed."""
    parts = [tuple(seeds[first : first + AT_ONCE]) for first in range(0, len(seeds), AT_ONCE)]
    tasks = [(name, part) for name in (*CASES, 'wheels') for part in parts]
    found = run_seeds(_run_task, tasks, progress)
    rows: list[Row] = []
    for name in CASES:
        runs = [
            item
            for task, some in zip(tasks, found, strict=True)
            if task[0] == name
            for item in some
        ]
        for label, values, bound in (
            (
                'RMS',
                [item.rms for item in runs],
                Bound(high=ASKED_RMS_M) if name == 'two anchors given' else None,
            ),
            ('RMS, moved onto the truth', [item.shape for item in runs], None),
            ('heights, RMS', [item.height for item in runs], None),
            (
                'NEES of a dimension',
                [item.nees for item in runs],
                _nees_bound(sum(item.dimensions for item in runs)),
            ),
        ):
            if label.startswith('heights') and not any(values):
                continue
            unit = '' if 'NEES' in label else 'm'
            rows.append(Row(f'{name}, {label}', unit, Spread.of(values), bound=bound))
    wheels = np.array(
        [
            item
            for task, some in zip(tasks, found, strict=True)
            if task[0] == 'wheels'
            for item in some
        ]
    )
    for column, label in enumerate(('mean radius', 'right less left radius', 'track')):
        sizes = Spread.of(np.abs(wheels[:, column]))
        rows.append(Row(f'wheels, {label}, error', '%', sizes))
    rows.append(
        Row(
            'wheels, NEES of a dimension',
            '',
            Spread.of(wheels[:, 3]),
            bound=_nees_bound(3 * len(wheels)),
        )
    )
    first = recorded(PROTOTYPE, seeds[:1])[0]
    return Outcome(
        'survey',
        'Survey of four anchors and calibration of wheels, drives of 40 m',
        tuple(seeds),
        tuple(rows),
        partial(_draw, found=survey(first.data, CASES['two anchors given'][1])),
        {'route': ROUTE, 'route of the wheels': WINDING, 'radii, track, spread': (0.02, 0.04)},
        (
            'Nothing is known of the anchors but what the name of a row says.',
            'Two anchors given, start given: noise of the prototype (Sun 2019), 0.103 m.',
            'Uncalibrated: the usual errors of the simulation; each anchor has a bias of its own '
            '(0.07 m) and a scale (0.5 %).',
            'NEES: errors squared over their stated variance; 1 is right, both sides bounded.',
        ),
    )


def _run_task(task: tuple[str, tuple[int, ...]]) -> list[Any]:
    name, seeds = task
    if name == 'wheels':
        drives = recorded(SensorErrors(wheels=WHEEL_ERRORS), seeds, WINDING)
        return [
            judge_wheels(fit_wheels(wheel_data(drive), WheelConfig()), drive.sizes)
            for drive in drives
        ]
    sensors, config = CASES[name]
    return [judge(survey(drive.data, config)) for drive in recorded(sensors, seeds)]


def _nees_bound(dimensions: int) -> Bound:
    """Return the two-sided bound of the mean NEES, as wide again: the noise is estimated, too."""
    low, high = chi_square_bounds(dimensions)
    return Bound(low / dimensions / NEES_SLACK, high / dimensions * NEES_SLACK)


NEES_SLACK = 1.25
"""For what the linear, normal theory of the bounds leaves out: slips, a drift that wanders."""


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def _draw(figure: Any, found: Survey) -> None:
    draw_survey(figure, found, ANCHORS)
