"""Many robots at once against one robot through the nodes' code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tablerunner.errors import ConfigError, TablerunnerError
from tablerunner.estimation import LocalizerConfig
from tablerunner.experiments import fleet_drive
from tablerunner.experiments.belief import estimated
from tablerunner.experiments.drive import (
    Drive,
    dead_reckoned,
    drive_route,
    errors_of,
    uwb_fixes,
)
from tablerunner.experiments.fleet_drive import (
    BATCHED,
    drive_fleet,
    estimated_fleet,
    ranged,
    reckoned,
)
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import (
    AnchorPlace,
    Person,
    RobotGeometry,
    Scenario,
    SensorErrors,
    UwbErrors,
    Wall,
    WheelErrors,
)
from tablerunner.simulation.fleet import FleetRecord
from tablerunner.simulation.truth import RangeTruth
from tablerunner.types import ExchangeSample, ImuSample, WheelSample
from tablerunner.uwb import PositionerConfig, RangerConfig, ranging
from tablerunner.uwb.batch import fixes_of

HULL = ((0.0, 0.0), (8.0, 0.0), (8.0, 7.0), (0.0, 7.0))
START = (2.0, 2.0, 0.3)
ROUTE = ((5.0, 2.0), (5.5, 4.5))
PEOPLE = (
    Person('a', ((1.0, 4.5), (3.5, 5.5), (7.0, 6.0))),
    Person('b', ((7.0, 1.0), (6.8, 4.0)), pause_probability=0.9),
)
LEVER = (-0.05, 0.0, 1.1)
UWB = UwbErrors(rate=9.0, bias_std=0.03, loss_probability=0.1, person_excess=(0.1, 0.7))
WHEELS = WheelErrors(slip_rate=0.2, slip_duration=0.5, slip_share=1.0)
SCENARIO = Scenario(
    name='small',
    walls=(Wall(HULL, 'hull', closed=True),),
    anchors=tuple(AnchorPlace(f'A{i}', (*place, 2.25)) for i, place in enumerate(HULL)),
    people=PEOPLE,
    start=START,
    robot=RobotGeometry(tag_position=LEVER, ultrasonics=()),
    sensors=SensorErrors(uwb=UWB, wheels=WHEELS),
)
RANGER = RangerConfig(
    anchor_ids=tuple(anchor.id for anchor in SCENARIO.anchors),
    anchor_positions=tuple(value for anchor in SCENARIO.anchors for value in anchor.position),
    anchor_biases=(0.01, -0.02, 0.03, 0.0),
    anchor_scales=(0.001, 0.0, -0.002, 0.0),
    nlos_offset=0.15,
)
POSITIONER = PositionerConfig(solver='three_circle')
ODOMETER = OdometerConfig()
SEEDS = (4, 5, 6)


def localizer(name: str) -> LocalizerConfig:
    return LocalizerConfig(
        estimator=name, tag_position=LEVER, initial_pose=START, positioner=POSITIONER
    )


def of_type(drive: Drive, kind: type) -> list[Any]:
    return [sample for sample in drive.samples if isinstance(sample, kind)]


def record_of(drives: list[Drive]) -> FleetRecord:
    """Return drives of one robot as those of a fleet, cut to the shortest."""
    stamps = min((drive.stamps for drive in drives), key=len)
    last = int(stamps[-1])
    rounds = [item for item in of_type(drives[0], RangeTruth) if item.stamp <= last]
    row = {item.stamp: index for index, item in enumerate(rounds)}
    flight = np.full((len(rounds), len(drives)), np.nan)
    gap = np.full(flight.shape, np.nan)
    wheels, rates = [], []
    imu_stamps = [item.stamp for item in of_type(drives[0], ImuSample) if item.stamp <= last]
    for run, drive in enumerate(drives):
        for item in of_type(drive, ExchangeSample):
            if item.stamp > last:
                continue
            times = ranging.intervals(
                item.poll_tx,
                item.poll_rx,
                item.response_tx,
                item.response_rx,
                item.final_tx,
                item.final_rx,
            )
            flight[row[item.stamp], run] = ranging.double_sided(*times)
            gap[row[item.stamp], run] = item.rx_power_dbm - item.first_path_power_dbm
        angles = [
            (item.left_angle_rad, item.right_angle_rad) for item in of_type(drive, WheelSample)
        ]
        wheels.append(np.array(angles)[: len(stamps)])
        yaw = [item.yaw_rate_rad_s for item in of_type(drive, ImuSample)]
        rates.append(np.array(yaw)[: len(imu_stamps)])
    return FleetRecord(
        stamps,
        np.stack([drive.poses[: len(stamps)] for drive in drives], axis=-1),
        np.stack(wheels, axis=-1),
        np.array(imu_stamps, dtype=np.int64),
        np.stack(rates, axis=-1),
        np.array([item.stamp for item in rounds], dtype=np.int64),
        np.array([RANGER.anchor_ids.index(item.anchor_id) for item in rounds]),
        flight,
        gap,
        np.zeros(flight.shape, dtype=bool),
        np.full(len(drives), last),
        np.full(len(drives), np.inf),
    )


@pytest.fixture(scope='module')
def drives() -> list[Drive]:
    return [drive_route(SCENARIO, seed, ROUTE, still_s=2.0) for seed in SEEDS]


@pytest.fixture(scope='module')
def record(drives) -> FleetRecord:
    return record_of(drives)


@pytest.mark.parametrize('source', ['gyro', 'wheels'])
def test_odometry_equals_the_nodes_on_the_same_samples(drives, record, source):
    """Bias learned while standing, gyro held between its samples, wheels that stand."""
    config = ODOMETER.replace(heading_source=source)
    places = reckoned(record, config).laid_on(START)
    for run, drive in enumerate(drives):
        _, expected = dead_reckoned(drive, config)
        assert places[:, :, run] == pytest.approx(expected[: len(places)], abs=1e-9)


def test_slips_are_noticed_as_by_the_nodes(drives, record):
    """What odometry says of its own distances, step by step."""
    track = reckoned(record, ODOMETER)
    slips = 0
    for run, drive in enumerate(drives):
        odometer, told = Odometer(ODOMETER), []
        for sample in drive.samples:
            if isinstance(sample, ImuSample):
                odometer.add_imu(sample)
            elif isinstance(sample, WheelSample):
                moved = odometer.add_wheels(sample)
                told.append(moved.twist_covariance[0, 0])
        slips += odometer.slips
        steps = np.diff(record.stamps) * 1e-9
        found = np.diff(track.told_variance[:, run]) / steps**2
        assert found == pytest.approx(told[1 : len(record.stamps)], abs=1e-9)
    assert slips > 2


def test_odometry_falls_back_on_the_wheels_while_the_gyro_is_silent(drives, record):
    """A second of silence in the middle, as in a drive whose samples were taken out."""
    begin, end = (int(record.imu_stamps[index]) for index in (600, 700))
    silent = (record.imu_stamps > begin) & (record.imu_stamps < end)
    cut = FleetRecord(
        **{
            **{name: getattr(record, name) for name in record.__dataclass_fields__},
            'imu_stamps': record.imu_stamps[~silent],
            'yaw_rate': record.yaw_rate[~silent],
        }
    )
    places = reckoned(cut, ODOMETER).laid_on(START)
    assert not np.allclose(places, reckoned(record, ODOMETER).laid_on(START), atol=1e-4)
    for run, drive in enumerate(drives):
        samples = tuple(
            item
            for item in drive.samples
            if not (isinstance(item, ImuSample) and begin < item.stamp < end)
        )
        _, expected = dead_reckoned(Drive(samples, drive.stamps, drive.poses), ODOMETER)
        assert places[:, :, run] == pytest.approx(expected[: len(places)], abs=1e-9)


def test_fixes_equal_those_of_the_positioner_on_the_same_samples(drives, record):
    """Every fix of every run, its stamp and place, with a tenth of the exchanges lost."""
    found = fixes_of(POSITIONER, RANGER.anchors, ranged(record, RANGER), record.end)
    for run, drive in enumerate(drives):
        stamps, places = uwb_fixes(drive, RANGER, POSITIONER)
        own = found.runs == run
        count = int(own.sum())
        assert count >= int(np.sum(stamps < record.end[run])) - 2  # rounds beyond the cut
        assert found.stamps[own].tolist() == stamps[:count].tolist()
        assert found.place[own] == pytest.approx(places[:count], abs=1e-9)


@pytest.mark.parametrize('name', BATCHED)
def test_estimates_equal_those_of_the_localizer_on_the_same_samples(drives, record, name):
    """The whole way through the nodes' code, late fixes and held velocity included."""
    track, ranges = reckoned(record, ODOMETER), ranged(record, RANGER)
    beliefs = dict(estimated_fleet(track, ranges, RANGER, localizer(name)))
    assert list(beliefs) == list(range(1, len(record.stamps)))
    for run, drive in enumerate(drives):
        stamps, places = estimated(drive, RANGER, ODOMETER, localizer(name))
        assert stamps[: len(record.stamps)].tolist() == record.stamps.tolist()
        found = np.array([beliefs[index][run] for index in beliefs])
        assert found == pytest.approx(places[1 : len(record.stamps)], abs=1e-8)


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def test_figures_of_a_fleet_are_those_of_single_drives():
    """Own drives on both sides: RMS of odometry, fixes and the filter agree on average.

    One filter is enough: on the same samples all of them are equal, see above.
    """
    single_seeds, fleet_seeds = range(100, 116), range(200, 280)
    sensors = SCENARIO.sensors
    slow = SCENARIO.replace(
        sensors=sensors.replace(
            wheels=sensors.wheels.replace(rate=10.0), imu=sensors.imu.replace(rate=20.0)
        )
    )
    singles: dict[str, list[float]] = {}
    for seed in single_seeds:
        drive = drive_route(slow, seed, ROUTE, still_s=2.0)
        rows = {
            'odometry': dead_reckoned(drive, ODOMETER),
            'fixes': uwb_fixes(drive, RANGER, POSITIONER),
            'ekf': estimated(drive, RANGER, ODOMETER, localizer('ekf')),
        }
        for name, (stamps, places) in rows.items():
            singles.setdefault(name, []).append(rms(errors_of(drive, stamps, places)))
        singles.setdefault('seconds', []).append((drive.stamps[-1] - drive.stamps[0]) * 1e-9)
        blocked = [bool(item.blocked_by) for item in of_type(drive, RangeTruth)]
        singles.setdefault('blocked', []).append(float(np.mean(blocked)))

    record = drive_fleet(slow, fleet_seeds, ROUTE, still_s=2.0)
    track, ranges = reckoned(record, ODOMETER), ranged(record, RANGER)
    counts, truth = record.counts, record.truth[:, :2]
    places = {'odometry': track.laid_on(START)}
    beliefs = estimated_fleet(track, ranges, RANGER, localizer('ekf'))
    places['ekf'] = np.stack([truth[0], *(believed.T for _, believed in beliefs)])
    many: dict[str, list[float]] = {
        name: [
            rms(np.hypot(*(found - truth)[counts[:, run], :, run].T)) for run in range(record.runs)
        ]
        for name, found in places.items()
    }
    fixes = fixes_of(POSITIONER, RANGER.anchors, ranges, record.end)
    many['fixes'] = []
    for run in range(record.runs):
        own = fixes.runs == run
        stamps = np.zeros((int(own.sum()), record.runs), dtype=np.int64)
        stamps[:, run] = fixes.stamps[own]
        off = fixes.place[own] - record.truth_at(stamps)[:, :, run]
        many['fixes'].append(rms(np.hypot(*off.T)))
    many['seconds'] = [(end - record.stamps[0]) * 1e-9 for end in record.end]
    during = record.uwb_stamps[:, None] <= record.end
    many['blocked'] = [
        float(record.blocked[during[:, run], run].mean()) for run in range(record.runs)
    ]
    for name, ours in many.items():
        theirs = singles[name]
        spread = math.hypot(np.std(ours) / len(ours) ** 0.5, np.std(theirs) / len(theirs) ** 0.5)
        assert abs(np.mean(ours) - np.mean(theirs)) < 4 * spread + 1e-3, name


def test_fleet_that_cannot_arrive_says_so(monkeypatch):
    """Half an hour is cut short here: a point farther away than the time that is allowed."""
    monkeypatch.setattr(fleet_drive, 'LONGEST_S', 3.0)
    with pytest.raises(TablerunnerError, match='not every run reached'):
        drive_fleet(SCENARIO.replace(people=()), (1,), ((2000.0, 2.0),))


@pytest.mark.parametrize(
    ('changes', 'words'),
    [({'estimator': 'ukf'}, 'kf, ekf_cv, ekf'), ({'initial_pose': ()}, 'yaw')],
)
def test_settings_that_many_robots_cannot_have_are_refused(record, changes, words):
    config = localizer('ekf').replace(**changes)
    beliefs = estimated_fleet(reckoned(record, ODOMETER), ranged(record, RANGER), RANGER, config)
    with pytest.raises(ConfigError, match=words):
        next(beliefs)


def test_other_tests_of_ranges_are_refused(record):
    with pytest.raises(ConfigError, match='signal_quality or none'):
        ranged(record, RANGER.replace(nlos_test='range_variance'))
    with pytest.raises(ConfigError, match='residual_test'):
        fixes_of(
            POSITIONER.replace(residual_test=True),
            RANGER.anchors,
            ranged(record, RANGER),
            record.end,
        )
