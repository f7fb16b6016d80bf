"""Sun's square, on fewer seeds than the command runs."""

import numpy as np
import pytest

from tablerunner.experiments.drive import dead_reckoned, drive_route, errors_of
from tablerunner.experiments.sun2019 import (
    PAPER_M,
    PEOPLE,
    ROUTE,
    drive_of,
    fixes_of,
    run_sun2019,
    scenario_of,
)
from tablerunner.odometry import OdometerConfig
from tablerunner.scenario import ImuErrors, SensorErrors, UwbErrors, WheelErrors
from tablerunner.simulation.truth import Contact


@pytest.fixture(scope='module')
def outcome():
    return run_sun2019(range(100, 106), lambda done, count: None)


def test_table_has_the_four_raw_rows_with_the_papers_means(outcome):
    assert [row.raw for row in outcome.rows] == [True] * 4
    assert [row.paper for row in outcome.rows] == [0.688, 0.602, 0.603, 0.929]
    assert PAPER_M['II']['uwb'] == (1.035, 0.823)


def test_rows_are_near_their_bounds(outcome):
    """Over 20 seeds they hold; the mean of six moves by 0.08 m (UWB) and 0.16 m (odometry)."""
    for row in outcome.rows:
        slack = 3.0 * (0.16 if 'odometry' in row.name else 0.08)
        assert row.bound.low - slack < row.measured.mean < row.bound.high + slack
    assert (
        outcome.row('situation II, UWB, max').measured.mean
        > outcome.row('situation I, UWB, max').measured.mean
    )


@pytest.mark.parametrize('situation', PEOPLE)
def test_nobody_is_touched(situation):
    """People keep off the track, so that the drive is the same whoever is there."""
    drive = drive_of(3, situation)
    assert not any(isinstance(sample, Contact) for sample in drive.samples)
    assert len(scenario_of(3, situation).people) == PEOPLE[situation]


def test_perfect_sensors_leave_no_error():
    """Then what is measured is the sensors' doing, not that of the chain."""
    room = scenario_of(0, 'I').replace(
        people=(),
        sensors=SensorErrors(
            uwb=UwbErrors(range_std=0.0, bias_std=0.0, scale_std=0.0, loss_probability=0.0),
            wheels=WheelErrors(
                radius_scale_std=0.0, track_scale_std=0.0, slip_rate=0.0, floor_noise=0.0
            ),
            imu=ImuErrors(gyro_std=0.0, gyro_bias_std=0.0, gyro_bias_walk=0.0, gyro_scale_std=0.0),
        ),
    )
    drive = drive_route(room, 1, ROUTE)
    # 0.5 m/s times half of the 0.1 s that an epoch lasts, and the steps of the timestamps.
    assert errors_of(drive, *fixes_of(drive)).max() < 0.06
    assert errors_of(drive, *dead_reckoned(drive, OdometerConfig())).max() < 0.05


def test_drive_follows_the_square():
    drive = drive_of(0, 'I')
    assert drive.poses[:, :2].min(axis=0) == pytest.approx([3.0, 3.0], abs=0.1)
    assert drive.poses[:, :2].max(axis=0) == pytest.approx([12.0, 12.0], abs=0.1)
    assert np.all(np.diff(drive.stamps) > 0)
