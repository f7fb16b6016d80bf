"""Sun's square, on fewer seeds than the command runs."""

import numpy as np
import pytest

from tablerunner.errors import TablerunnerError
from tablerunner.experiments import sun2019
from tablerunner.experiments.drive import dead_reckoned, drive_route, errors_of
from tablerunner.experiments.sun2019 import (
    PAPER_M,
    PEOPLE,
    ROUTE,
    drive_of,
    fixes_of,
    fused_of,
    run_situation,
    run_sun2019,
    scenario_of,
)
from tablerunner.odometry import OdometerConfig
from tablerunner.scenario import ImuErrors, Person, SensorErrors, UwbErrors, WheelErrors
from tablerunner.simulation.truth import Contact

FILTERS = ('kf', 'ekf_cv', 'ekf')


@pytest.fixture(scope='module')
def outcome():
    return run_sun2019(range(100, 120), lambda done, count: None)


def test_table_has_the_raw_rows_first_with_the_papers_means(outcome):
    assert [row.raw for row in outcome.rows] == [True] * 4 + [False] * 6
    assert [row.paper for row in outcome.rows[:4]] == [0.688, 0.602, 0.603, 0.929]
    fused = [row.paper for row in outcome.rows[4:]]
    assert fused == [0.15, 0.15, None, 0.152, 0.152, None]
    assert PAPER_M['II']['uwb'] == (1.035, 0.823)
    names = [f'situation {situation}, {name}, max' for situation in PEOPLE for name in FILTERS]
    assert [row.name for row in outcome.rows[4:]] == names


def test_rows_keep_their_bounds_on_other_seeds(outcome):
    """Twenty of them: the means of such blocks move by 0.02 m and less, see the docs."""
    for row in outcome.rows:
        assert row.holds, row.name
    crowd, few = (outcome.row(f'situation {name}, UWB, max').measured for name in ('II', 'I'))
    assert crowd.mean > few.mean


def test_seed_does_not_depend_on_those_beside_it(monkeypatch):
    """To the last bit, whatever is kept, for every row of the table."""
    monkeypatch.setattr(sun2019, 'ROUTE', ((3.0, 4.0), (4.5, 4.0)))
    alone = run_situation('II', (104,))
    among = run_situation('II', (102, 104, 103), keep='all')
    pairs = [(alone.odometry, among.odometry), (alone.uwb, among.uwb)]
    pairs += [(alone.fused[name], among.fused[name]) for name in FILTERS]
    for one, many in pairs:
        for figure in ('largest', 'mean', 'rms', 'final'):
            assert getattr(one, figure)[0] == getattr(many, figure)[1]
        assert one.errors is None
        assert np.nanmax(many.errors[:, 1]) == many.largest[1]
        assert np.isfinite(many.places[0]).all() or many is not among.uwb


def test_summaries_do_not_grow_with_the_length_of_the_runs(monkeypatch):
    """Of runs four times as long as many bytes stay; of whole errors four times as many."""
    kept = {}
    for keep in ('summary', 'errors'):
        for name, route in (('short', ((3.0, 3.6),)), ('long', ((3.0, 6.0),))):
            monkeypatch.setattr(sun2019, 'ROUTE', route)
            runs = run_situation('I', (1, 2), keep)
            kept[keep, name] = sum(
                value.nbytes
                for errors in (runs.odometry, runs.uwb, *runs.fused.values())
                for value in vars(errors).values()
                if value is not None
            )
    assert kept['summary', 'short'] == kept['summary', 'long'] == 2 * 5 * 4 * 8
    stamps = (kept['errors', 'long'] - kept['errors', 'short']) / (2 * 5 * 8)
    # 2.4 m at half a metre a second and 10 Hz, nearly as many fixes.
    assert stamps == pytest.approx(2.4 / 0.5 * 10, rel=0.1)


def test_figures_of_single_drives_lie_among_those_of_the_fleet(outcome):
    """The nodes' code on drives of one robot: a cross-check of the whole chain."""
    for situation in PEOPLE:
        drive = drive_of(101, situation)
        rows = {
            'IMU-aided odometry': dead_reckoned(drive, sun2019.odometer()),
            'UWB': fixes_of(drive),
            'ekf': fused_of(drive, 'ekf'),
        }
        for name, (stamps, places) in rows.items():
            spread = outcome.row(f'situation {situation}, {name}, max').measured
            largest = errors_of(drive, stamps, places).max()
            # One draw against the range of twenty, and half of its width to either side.
            slack = 0.5 * (spread.high - spread.low)
            assert spread.low - slack < largest < spread.high + slack, name


def test_person_on_the_track_ends_the_experiment(monkeypatch):
    """A fleet feels no touch: what it would measure after one is worth nothing."""
    monkeypatch.setattr(sun2019, 'ROUTE', ((3.0, 5.0),))
    monkeypatch.setattr(sun2019, '_people_in', lambda *_: (Person('him', ((3.0, 4.0),)),))
    with pytest.raises(TablerunnerError, match='seed 7: somebody stands in the way'):
        run_situation('I', (7,))


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
