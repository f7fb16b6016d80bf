"""Estimators beside the bound: a matched filter is consistent, a wrong one is found out."""

from dataclasses import replace

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.experiments.compare import Setup, clear_of, compared, one_seed, run_compare
from tablerunner.experiments.matched import matched
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

ROUTE = ((2.0, 7.0), (8.0, 7.0))
SEEDS = range(300, 324)
# Odometry loses certainty fast and biases are small, so that errors soon forget each other: few
# runs then show what a wrong noise does.
SENSORS = SensorErrors(
    uwb=UwbErrors(rate=10.0, range_std=0.05, bias_std=0.003, scale_std=0.0),
    wheels=WheelErrors(rate=20.0, slip_rate=0.0, floor_noise=0.008, radius_scale_std=0.002),
    imu=ImuErrors(gyro_std=0.1, gyro_bias_std=0.002, gyro_scale_std=0.002),
)
CORNERS = ((0.0, 0.0), (10.0, 0.0), (10.0, 9.0), (0.0, 9.0))
ROOM = Scenario(
    name='small room',
    walls=(Wall(CORNERS, 'outer wall', closed=True),),
    anchors=tuple(AnchorPlace(f'A{index}', (x, y, 2.25)) for index, (x, y) in enumerate(CORNERS)),
    people=(Person('someone', ((5.0, 4.0),), radius=0.4),),
    start=(2.0, 2.0, 1.5707963),
    robot=replace(RobotGeometry(), ultrasonics=()),
    sensors=SENSORS,
)
CLEAR = clear_of(ROOM)


def comparison_of(scenario=CLEAR, factor=1.0, seeds=SEEDS, estimators=('ekf',)):
    """Return the comparison with the matched process noise times a factor."""
    setup = Setup(scenario, ROUTE, estimators)
    config = matched(scenario, setup.speed)
    fitted = config.localizer.filter
    motion = replace(
        fitted.motion,
        distance=factor * fitted.motion.distance,
        heading_per_time=factor * fitted.motion.heading_per_time,
    )
    localizer = replace(config.localizer, filter=replace(fitted, motion=motion))
    setup = replace(setup, config=replace(config, localizer=localizer))
    return compared(setup, [one_seed(seed, setup) for seed in seeds])


@pytest.fixture(scope='module')
def right():
    """Return the ekf with matched noise, all ranges clear."""
    return comparison_of()


def test_matched_ekf_is_consistent_and_near_the_bound(right):
    """Between 0.93 and 1.07 over four other sets of as many seeds, and 0.95 to 1.00 inside."""
    ekf = right.estimators[0]
    assert 0.9 < ekf.rmse / right.bound_rmse < 1.1
    assert 0.9 < ekf.heading_rmse / right.bound_heading_rmse < 1.1
    assert ekf.average_nees.inside > 0.9
    assert ekf.average_nis.inside > 0.92
    # Safeguards (Huber, doubt) cost the filter a little where there is nothing to guard against.
    assert 0.99 < ekf.believed_rmse / right.bound_rmse < 1.15


@pytest.mark.parametrize(('factor', 'sign'), [(0.5, 1.0), (2.0, -1.0)])
def test_ekf_with_half_or_double_the_process_noise_is_found_out(factor, sign):
    """Too sure: NEES too large; too shy: too small; most steps lie outside."""
    nees = comparison_of(factor=factor).estimators[0].average_nees
    assert nees.inside < 0.5
    assert sign * (nees.mean - 1.0) > 0.25


def test_ekf_beside_somebody_who_blocks_ranges_stays_consistent():
    blocked = comparison_of(ROOM).estimators[0]
    assert blocked.average_nees.inside > 0.8
    assert blocked.average_nis.inside > 0.8


def test_runs_do_not_depend_on_the_number_of_workers():
    setup = Setup(CLEAR, ROUTE[:1], ('ekf', 'dead_reckoning'))
    alone, together = (run_compare(setup, [5, 3], workers=count) for count in (1, 2))
    for one, other in zip(alone, together, strict=True):
        assert one.seed == other.seed
        np.testing.assert_array_equal(one.bound, other.bound)
        for name in setup.estimators:
            np.testing.assert_array_equal(one.runs[name].errors, other.runs[name].errors)
            np.testing.assert_array_equal(one.runs[name].nis, other.runs[name].nis)


def test_all_estimators_begin_at_the_same_pose_and_are_cut_to_the_shortest_drive():
    setup = Setup(CLEAR, ROUTE[:1], ('ekf', 'dead_reckoning'))
    seeds = [one_seed(seed, setup) for seed in (3, 4)]
    seeds[0] = replace(seeds[0], times=seeds[0].times[:-40], range_times=seeds[0].range_times[:-9])
    comparison = compared(setup, seeds)
    assert len(comparison.times) <= len(seeds[0].times)
    first = [item.errors[:, 0] for item in comparison.estimators]
    np.testing.assert_allclose(first[0], first[1], atol=1e-12)
    assert comparison.estimators[1].nis.shape == (2, len(comparison.range_times))


def test_nothing_is_blocked_where_nothing_stands():
    assert one_seed(1, Setup(ROOM, ROUTE[:1], ('ekf',))).blocked > 0.01
    assert one_seed(1, Setup(CLEAR, ROUTE[:1], ('ekf',))).blocked == 0.0


@pytest.mark.parametrize('names', [(), ('ekf', 'oracle')])
def test_setup_with_unknown_or_no_estimators_is_refused(names):
    with pytest.raises(ConfigError, match='ekf, ukf'):
        Setup(ROOM, ROUTE, names)


def test_comparison_of_no_runs_is_refused():
    with pytest.raises(ConfigError, match='at least one'):
        compared(Setup(ROOM, ROUTE, ('ekf',)), [])
