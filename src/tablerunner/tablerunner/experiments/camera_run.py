"""The camera run: one counter-clockwise turn under a ceiling camera, 10 Hz, pictures and all.

The robot drives a circle; every picture is drawn, the marker found in it, and the pose that comes
out fused with odometry (and ranges) by the code of the nodes. The camera is calibrated as a user
would do it: from marked points, clicked and measured with errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import TablerunnerError
from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.estimation.registry import ESTIMATORS
from tablerunner.experiments.drive import Drive
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.angles import wrap
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import AnchorPlace, Camera, Marker, RobotGeometry, Scenario, Table, Wall
from tablerunner.simulation import Sample, Simulator
from tablerunner.simulation.camera.rays import Rays
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import Truth
from tablerunner.types import (
    ExchangeSample,
    ImageSample,
    ImuSample,
    Lens,
    OdometrySample,
    PoseSample,
    RangeSample,
    Velocity,
    WheelSample,
)
from tablerunner.uwb import Ranger, RangerConfig
from tablerunner.vision import (
    CameraMount,
    CeilingLocator,
    LocatorConfig,
    MarkerConfig,
    Observation,
    course,
    draw_overlay,
)
from tablerunner.vision.calibration import fit_mount

Array = NDArray[np.float64]
Sensed = OdometrySample | RangeSample | PoseSample

WIDTH_M, DEPTH_M = 6.4, 5.0
RADIUS_M, SPEED_M_S = 0.6, 0.685
START = (WIDTH_M / 2 + RADIUS_M, DEPTH_M / 2, math.pi / 2)
STILL_S = 1.0
"""Standing before the turn; errors count from when the robot drives."""

LONGEST_S = 30.0
MARKER = Marker()
HUE_DEG = 329.0
CAMERA = Camera(
    (WIDTH_M / 2, DEPTH_M / 2, 4.2),
    focal=(290.0, 290.0),
    distortion=(-0.13, 0.018, 0.0006, -0.0004, -0.001),
    clutter=12,
    # What the installer measured is a first guess only: the marked points tell.
    position_std=0.05,
    angle_std=0.02,
)
MARKED_POINTS = 10
CLICK_STD_PX, TAPE_STD_M = 0.5, 0.002
START_STD = (0.1, 0.1, 0.1)

ESTIMATORS_HERE = ('ekf', 'pf_uiekf')
SOURCES = {'camera': (PoseSample,), 'UWB': (RangeSample,), 'both': (PoseSample, RangeSample)}
EKF_MEAN_M, PF_MEAN_M, PF_MAX_M = 0.015, 0.037, 0.048
PAPER_MEAN_M, PAPER_MAX_M = 0.0374, 0.048


@dataclass(frozen=True)
class CameraRun:
    """One turn.

    Attributes
    ----------
    place, heading, course : ndarray, shape (k,)
        Errors of the camera alone: places [m], headings of the marker and courses (6) [rad].
    seen : float
        Share of the pictures in which the robot was found.
    fused : dict of str to ndarray, shape (m,)
        Errors of places by ``ESTIMATOR, SOURCE`` [m].
    turn_s : float
        How long the turn took [s].
    truth, seen_at, believed : ndarray, shape (..., 2)
        For the picture [m]; believed by the ekf with the camera.
    view : ndarray of uint8, shape (height, width, 3)
        A picture of the turn with what was found in it.
    """

    place: Array
    heading: Array
    course: Array
    seen: float
    fused: dict[str, Array]
    turn_s: float
    truth: Array
    seen_at: Array
    believed: Array
    view: NDArray[np.uint8]


def run_camera(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Run the turn for many seeds."""
    runs = run_seeds(run_turn, tuple(seeds), progress)
    rows = [
        Row('camera only, place, mean', 'm', _spread(runs, 'place', np.mean), raw=True),
        Row('camera only, place, max', 'm', _spread(runs, 'place', np.max), raw=True),
        Row('camera only, heading of the marker, mean', 'rad', _spread(runs, 'heading'), raw=True),
        Row('camera only, course from motion, mean', 'rad', _spread(runs, 'course'), raw=True),
        Row(
            'camera only, pictures with a pose, share',
            '1',
            Spread.of([run.seen for run in runs]),
            raw=True,
            bound=Bound(low=0.98),
        ),
    ]
    for estimator in _estimators():
        for source in SOURCES:
            errors = [run.fused[f'{estimator}, {source}'] for run in runs]
            rows += _fused_rows(estimator, source, errors)
        rows.append(_gain_row(estimator, runs))
    return Outcome(
        'ceiling_camera',
        'The camera run: one counter-clockwise turn, 10 Hz, pictures drawn and searched',
        tuple(seeds),
        tuple(rows),
        partial(draw, run=runs[0]),
        {
            'radius [m]': RADIUS_M,
            'speed [m/s]': SPEED_M_S,
            'turn [s]': float(np.mean([run.turn_s for run in runs])),
            'camera height [m]': CAMERA.position[2],
            'marked points': MARKED_POINTS,
            'deviation of a click [pixel]': CLICK_STD_PX,
            'deviation of a measured place [m]': TAPE_STD_M,
            'deviation of the start [m, m, rad]': list(START_STD),
        },
        (
            'The paper gives no row of its camera alone; its mean and largest error are those of '
            'PF-UIEKF (3.74 cm, 4.8 cm at 55 points).',
            'Each seed has its own camera (place, angles, focal length), light, floor, clutter, '
            'calibration and start.',
            'Errors are of the live estimate at each odometry (50 Hz), with pictures that arrive '
            f'{1000 * CAMERA.delay:.0f} ms after their exposure.',
            'Both over the better of the two: below 1, the second source helps.',
        ),
    )


def _estimators() -> tuple[str, ...]:
    return tuple(name for name in ESTIMATORS_HERE if name in ESTIMATORS)


def _spread(runs: Sequence[CameraRun], name: str, of: Any = np.mean) -> Spread:
    return Spread.of([float(of(np.abs(getattr(run, name)))) for run in runs])


def _fused_rows(estimator: str, source: str, errors: Sequence[Array]) -> list[Row]:
    mean = Spread.of([float(item.mean()) for item in errors])
    largest = Spread.of([float(item.max()) for item in errors])
    with_camera, particles = source != 'UWB', estimator == 'pf_uiekf'
    mean_bound = Bound(high=PF_MEAN_M if particles else EKF_MEAN_M) if with_camera else None
    max_bound = Bound(high=PF_MAX_M) if with_camera and particles else None
    paper = particles and source == 'camera'
    return [
        Row(
            f'{estimator}, {source}, mean',
            'm',
            mean,
            PAPER_MEAN_M if paper else None,
            bound=mean_bound,
        ),
        Row(
            f'{estimator}, {source}, max',
            'm',
            largest,
            PAPER_MAX_M if paper else None,
            bound=max_bound,
        ),
    ]


def _gain_row(estimator: str, runs: Sequence[CameraRun]) -> Row:
    ratios = []
    for run in runs:
        camera, uwb, both = (float(run.fused[f'{estimator}, {name}'].mean()) for name in SOURCES)
        ratios.append(both / min(camera, uwb))
    return Row(
        f'{estimator}, both over the better of the two, ratio',
        '1',
        Spread.of(ratios),
        # Asked of the ekf: the cloud of particles is coarser than what the camera leaves open.
        bound=Bound(high=1.0) if estimator == 'ekf' else None,
    )


def run_turn(seed: int) -> CameraRun:
    """Drive one turn, look at every picture, and fuse what it says."""
    scenario = room()
    simulator = Simulator(scenario, seed)
    lens, mount = calibrated(simulator, seed)
    marker = MarkerConfig(hues=(HUE_DEG,), heights=(MARKER.height,))
    locator = CeilingLocator(LocatorConfig(mount=mount, marker=marker), lens)
    drive, begin = _drive(simulator)
    sensed, poses, pictures = _sense(drive, locator, scenario)
    # A turn is measured from when the robot drives.
    poses = [pose for pose in poses if pose.stamp >= begin]
    stamps = np.array([pose.stamp for pose in poses], dtype=np.int64)
    places = np.array([(pose.pose.x, pose.pose.y) for pose in poses])
    headings = np.array([pose.pose.heading for pose in poses])
    heading = np.interp(stamps, drive.stamps, np.unwrap(drive.poses[:, 2]))
    fused, believed = {}, np.empty((0, 2))
    for estimator in _estimators():
        for source, kinds in SOURCES.items():
            used = [item for item in sensed if isinstance(item, (OdometrySample, *kinds))]
            at, path = _believe(used, estimator, seed, scenario)
            fused[f'{estimator}, {source}'] = _errors(drive, at, path, begin)
            if (estimator, source) == ('ekf', 'camera'):
                believed = path[at >= begin]
    return CameraRun(
        np.linalg.norm(places - drive.place_at(stamps), axis=1),
        wrap(headings - heading),
        wrap(course(places[:-1], places[1:]) - heading[1:]),
        len(stamps) / max(sum(stamp >= begin for stamp in pictures), 1),
        fused,
        float(drive.stamps[-1] - begin) / 1e9,
        drive.poses[drive.stamps >= begin, :2],
        places,
        believed,
        _view(drive, locator),
    )


def _view(drive: Drive, locator: CeilingLocator) -> NDArray[np.uint8]:
    """Return a picture of the middle of the turn, with what is found in it."""
    images = [sample for sample in drive.samples if isinstance(sample, ImageSample)]
    middle = images[len(images) // 2]
    again = CeilingLocator(locator.config, locator.lens)
    found = again.add(middle)
    return draw_overlay(middle.pixels, again.camera, locator.config.marker, found)


def room() -> Scenario:
    """Return the room: a camera over its middle, a table in each corner, four anchors."""
    corners = ((0.0, 0.0), (WIDTH_M, 0.0), (WIDTH_M, DEPTH_M), (0.0, DEPTH_M))
    tables = tuple(
        Table(f'table_{index}', x, y, (x + (1.2 if x < 3 else -1.2), y, 0.0), length=1.0)
        for index, (x, y) in enumerate(((0.9, 0.9), (5.5, 0.9), (5.5, 4.1), (0.9, 4.1)))
    )
    return Scenario(
        name='camera run',
        walls=(Wall(corners, 'outer wall', closed=True),),
        tables=tables,
        anchors=tuple(
            AnchorPlace(
                f'A{index}',
                (min(max(x, 0.2), WIDTH_M - 0.2), min(max(y, 0.2), DEPTH_M - 0.2), 2.25),
            )
            for index, (x, y) in enumerate(corners)
        ),
        start=START,
        robot=RobotGeometry(marker=MARKER, ultrasonics=()),
        camera=CAMERA,
    )


def calibrated(simulator: Simulator, seed: int) -> tuple[Lens, CameraMount]:
    """Return lens and mount as a user finds them, by `tablerunner calibrate camera`.

    The lens is the nominal one, off by what the focal length of this camera is; the mount comes
    from points on floor and furniture, clicked and measured with errors.
    """
    if simulator.camera is None:
        raise TablerunnerError('the scenario has no camera')
    rng = stream(seed, 'marked points')
    lens = Lens(CAMERA.width, CAMERA.height, CAMERA.focal, CAMERA.middle, CAMERA.distortion)
    low, high = (0.9, 0.9, 0.0), (WIDTH_M - 0.9, DEPTH_M - 0.9, 1.0)
    places = rng.uniform(low, high, (MARKED_POINTS, 3))
    places[::2, 2] = 0.0
    clicks = Rays(simulator.camera.view.camera).project(places)
    clicks = clicks + rng.normal(0.0, CLICK_STD_PX, clicks.shape)
    measured = places + rng.normal(0.0, TAPE_STD_M, places.shape)
    return lens, fit_mount(lens, clicks, measured).mount


def _drive(simulator: Simulator) -> tuple[Drive, int]:
    """Return one turn and the stamp at which it began."""
    samples: list[Sample] = []
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    first, turned, last = simulator.now_ns, 0.0, START[2]
    begin = first + round(STILL_S * 1e9)
    while turned < 2.0 * math.pi:
        if simulator.now_ns > first + LONGEST_S * 1e9:
            raise TablerunnerError('camera run: the turn was not driven')
        drives = simulator.now_ns >= begin
        command = Velocity(SPEED_M_S, SPEED_M_S / RADIUS_M) if drives else Velocity()
        for sample in simulator.step(command):
            samples.append(sample)
            if isinstance(sample, Truth):
                stamps.append(sample.stamp)
                poses.append((sample.pose.x, sample.pose.y, sample.pose.heading))
                turned += wrap(sample.pose.heading - last)
                last = sample.pose.heading
    return Drive(tuple(samples), np.array(stamps, dtype=np.int64), np.array(poses)), begin


def _sense(
    drive: Drive, locator: CeilingLocator, scenario: Scenario
) -> tuple[list[Sensed], list[PoseSample], list[int]]:
    """Return what nodes make of a drive, in order of arrival; the camera's poses; its stamps."""
    anchors = scenario.anchors
    ranging = Ranger(
        RangerConfig(
            anchor_ids=tuple(anchor.id for anchor in anchors),
            anchor_positions=tuple(value for anchor in anchors for value in anchor.position),
        )
    )
    odometry = Odometer(OdometerConfig())
    sensed: list[Sensed] = []
    poses: list[PoseSample] = []
    pictures: list[int] = []
    for sample in drive.samples:
        if isinstance(sample, ImuSample):
            odometry.add_imu(sample)
        elif isinstance(sample, WheelSample):
            moved = odometry.add_wheels(sample)
            if isinstance(moved, OdometrySample):
                sensed.append(moved)
        elif isinstance(sample, ExchangeSample):
            ranged = ranging.add(sample)
            if isinstance(ranged, RangeSample):
                sensed.append(ranged)
        elif isinstance(sample, ImageSample):
            pictures.append(sample.stamp)
            for seen in locator.add(sample):
                if isinstance(seen, Observation):
                    poses.append(seen.sample)
                    sensed.append(seen.sample)
    return sensed, poses, pictures


def _believe(
    sensed: Sequence[Sensed], estimator: str, seed: int, scenario: Scenario
) -> tuple[NDArray[np.int64], Array]:
    """Return stamps and places of what an estimator believed whenever odometry had come."""
    off = np.array(START_STD) * stream(seed, 'camera run start').standard_normal(3)
    x, y, heading = (float(a + b) for a, b in zip(START, off, strict=True))
    config = LocalizerConfig(
        estimator=estimator,
        tag_position=scenario.robot.tag_position,
        initial_pose=(x, y, heading),
        initial_pose_std=START_STD,
    )
    fusing = Localizer(config, tuple(place.anchor for place in scenario.anchors))
    stamps, places = [], []
    for sample in sensed:
        if isinstance(sample, RangeSample):
            fusing.add_range(sample)
        elif isinstance(sample, PoseSample):
            fusing.add_pose(sample)
        else:
            fusing.add_odometry(sample)
            if fusing.estimate is not None:
                stamps.append(fusing.estimate.stamp)
                places.append(fusing.estimate.mean[:2])
    return np.array(stamps, dtype=np.int64), np.array(places).reshape(-1, 2)


def _errors(drive: Drive, stamps: NDArray[np.int64], places: Array, begin: int) -> Array:
    after = stamps >= begin
    return np.asarray(
        np.linalg.norm(places[after] - drive.place_at(stamps[after]), axis=1), dtype=float
    )


def draw(figure: Any, run: CameraRun) -> None:
    """Draw the first seed's turn: truth, what the camera saw, what was believed."""
    from tablerunner.evaluation.plots import style

    seen, axes, below = figure.subplots(1, 3, width_ratios=(1.5, 1.0, 1.0))
    seen.imshow(run.view[..., ::-1])
    seen.set_axis_off()
    seen.set_title('What the camera sees', loc='left')
    axes.plot(*run.truth.T, color=style.TRUTH, linewidth=1.0, label='truth')
    axes.plot(*run.seen_at.T, '.', color=style.FIX, markersize=4, label='camera')
    axes.plot(*run.believed.T, color=style.ESTIMATE, linewidth=1.0, label='ekf with camera')
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')
    axes.set_title('One turn', loc='left')
    axes.legend(loc='center')
    for name, colour in (('UWB', style.NLOS), ('camera', style.ESTIMATE), ('both', style.ANCHOR)):
        errors = run.fused[f'ekf, {name}']
        below.plot(np.linspace(0, run.turn_s, len(errors)), 1e3 * errors, color=colour, label=name)
    below.set_yscale('log')
    below.set_xlabel('time [s]')
    below.set_ylabel('error of the ekf [mm]')
    below.set_title('Error by source', loc='left')
    below.legend()
