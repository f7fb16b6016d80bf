"""The fleet against the one-robot simulator: equal where it can be, alike where it cannot."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.scenario import SensorErrors
from tablerunner.simulation import Simulator
from tablerunner.simulation.fleet import Fleet, FleetRecord
from tablerunner.simulation.truth import RangeTruth, Truth
from tablerunner.types import ExchangeSample, ImuSample, Velocity, WheelSample
from tablerunner.uwb import ranging

SEEDS = (3, 11)


def commands(step: int) -> tuple[float, float]:
    """Return a drive with starts, turns on the spot, curves and standing."""
    phase = step % 500
    if phase < 150:
        return 0.5, 0.4 * math.sin(step / 40)
    return (0.0, 0.9) if phase < 230 else (-0.1, 0.0) if phase < 300 else (0.0, 0.0)


def drive_fleet(
    scenario: Any, seeds: tuple[int, ...], steps: int, people: Any = None
) -> FleetRecord:
    fleet = Fleet(scenario, seeds, people)
    every = np.ones(len(seeds), dtype=bool)
    for step in range(steps):
        linear, angular = commands(step)
        fleet.step(np.full(len(seeds), linear), np.full(len(seeds), angular), every)
    return fleet.record(np.full(len(seeds), fleet.now_ns))


def drive_one(scenario: Any, seed: int, steps: int) -> dict[type, list[Any]]:
    simulator = Simulator(scenario, seed)
    found: dict[type, list[Any]] = {}
    for step in range(steps):
        for sample in simulator.step(Velocity(*commands(step))):
            found.setdefault(type(sample), []).append(sample)
    return found


@pytest.fixture
def scenario(make_scenario, make_person):
    """Everything errs but what cannot be drawn in the same order: floor, slips and ranges."""
    return make_scenario(
        people=(
            make_person(name='in the way', route=((3.0, 5.2), (7.5, 5.0)), patience=1.0),
            make_person(name='rests', route=((5.0, 2.0), (8.0, 8.0)), pause_probability=0.7),
            make_person(name='round', route=((1, 1), (9, 1), (5, 9)), loop=True, speed=1.3),
        ),
        errors={
            'wheels': {
                'ticks_per_turn': 2048,
                'radius_scale_std': 0.01,
                'radius_scale': (0.01, -0.005),
                'track_scale_std': 0.02,
            },
            'imu': {
                'rate': 50.0,
                'gyro_std': 0.01,
                'gyro_bias_std': 0.02,
                'gyro_bias_walk': 0.001,
                'gyro_scale_std': 0.01,
            },
            'uwb': {'bias_std': 0.2, 'scale_std': 0.01},
        },
    )


def test_fleet_equals_the_simulator_where_the_draws_are_the_same(scenario):
    """Wheels, gyro, truth and what lies between the antennas, with people who yield and turn."""
    record = drive_fleet(scenario, SEEDS, 3000)
    for run, seed in enumerate(SEEDS):
        one = drive_one(scenario, seed, 3000)
        truth = np.array([(s.pose.x, s.pose.y, s.pose.heading) for s in one[Truth]])
        assert record.stamps.tolist() == [sample.stamp for sample in one[Truth]]
        assert record.truth[:, :2, run] == pytest.approx(truth[:, :2], abs=1e-9)
        turned = record.truth[:, 2, run] - truth[:, 2]
        assert np.cos(turned) == pytest.approx(np.ones(len(turned)), abs=1e-12)
        wheels = [(s.left_angle_rad, s.right_angle_rad) for s in one[WheelSample]]
        assert record.wheels[:, :, run] == pytest.approx(np.array(wheels), abs=1e-9)
        assert record.imu_stamps.tolist() == [sample.stamp for sample in one[ImuSample]]
        rates = [sample.yaw_rate_rad_s for sample in one[ImuSample]]
        assert record.yaw_rate[:, run] == pytest.approx(rates, abs=1e-9)
        ranges = one[RangeTruth]
        assert record.uwb_stamps.tolist() == [sample.stamp for sample in ranges]
        assert [f'A{index}' for index in record.anchor] == [item.anchor_id for item in ranges]
        blocked = [bool(item.blocked_by) for item in ranges]
        assert record.blocked[:, run].tolist() == blocked
        assert 0.02 < np.mean(blocked) < 0.5
        # No noise: what differs are the clocks' drift and the steps of the timestamps.
        exchanges = one[ExchangeSample]
        assert len(exchanges) == len(ranges)
        flights = [
            ranging.double_sided(
                *ranging.intervals(
                    s.poll_tx, s.poll_rx, s.response_tx, s.response_rx, s.final_tx, s.final_rx
                )
            )
            for s in exchanges
        ]
        # Three roundings of half a tick (4.7 mm), weighed 1/4, 1/2, 1/4.
        off = ranging.distance(record.flight_s[:, run] - np.array(flights))
        assert np.abs(off).max() < 0.0025
        gaps = [s.rx_power_dbm - s.first_path_power_dbm for s in exchanges]
        clear = ~record.blocked[:, run]
        assert record.gap_db[clear, run] == pytest.approx(np.array(gaps)[clear], abs=1e-9)


def test_somebody_yielded_and_turned_back_in_that_drive(scenario):
    """Else the test above says nothing of it: without a robot the way is another one."""
    far = scenario.replace(start=(1.0, 9.0, 0.0))
    positions = []
    for room in (scenario, far):
        fleet = Fleet(room, SEEDS)
        for _ in range(3000):
            fleet.step(np.zeros(2), np.zeros(2), np.ones(2, dtype=bool))
        positions.append(fleet.crowd.places[:, 0, 0])
    assert np.linalg.norm(positions[0] - positions[1]) > 0.5


@pytest.mark.parametrize('others', [(7, 5, 9), (7,), (1, 2, 3, 4, 7)])
def test_run_does_not_depend_on_the_other_runs(make_scenario, make_person, others):
    """To the last bit, with every sensor erring, whichever seeds run beside it."""
    people = (make_person(name='a', pause_probability=0.5), make_person(name='b', speed=0.7))
    room = make_scenario(people=people, sensors=SensorErrors())
    alone = drive_fleet(room, (7,), 800)
    together = drive_fleet(room, others, 800)
    run = others.index(7)
    for field in fields(FleetRecord):
        one, many = getattr(alone, field.name), getattr(together, field.name)
        if one.shape[-1:] == (1,):
            assert np.array_equal(many[..., run], one[..., 0], equal_nan=True), field.name
        else:
            assert np.array_equal(many, one), field.name


def test_runs_of_different_seeds_differ(make_scenario):
    record = drive_fleet(make_scenario(sensors=SensorErrors()), (1, 2), 300)
    for values in (record.wheels, record.yaw_rate, record.flight_s, record.gap_db):
        assert not np.allclose(values[..., 0], values[..., 1], equal_nan=True)


def test_way_over_the_floor_spreads_as_the_noise_says(make_scenario):
    """Noise of each wheel adds up to `floor_noise` times the root of its way."""
    room = make_scenario(errors={'wheels': {'floor_noise': 0.01}})
    seeds = tuple(range(400))
    fleet = Fleet(room, seeds)
    for _ in range(600):
        fleet.step(np.full(400, 0.3), np.zeros(400), np.ones(400, dtype=bool))
    turned = fleet.base.heading - room.start_pose.heading
    way = np.mean(fleet.base.angle_rad) * room.robot.wheel_radius
    expected = 0.01 * math.sqrt(2 * way) / room.robot.track
    # The standard deviation of 400 draws is off by 3.5 %: three times that.
    assert np.std(turned) == pytest.approx(expected, rel=0.11)
    assert abs(np.mean(turned)) < 4 * expected / 20


def test_slips_lose_as_much_way_as_those_of_the_one_robot_drive(make_scenario):
    """A share that hangs on how often, how long and how much they slip."""
    errors = {'wheels': {'slip_rate': 0.5, 'slip_duration': 0.4, 'slip_share': 0.6}}
    room = make_scenario(errors=errors)
    count = 300
    fleet = Fleet(room, tuple(range(count)))
    for _ in range(800):
        fleet.step(np.full(count, 0.4), np.zeros(count), np.ones(count, dtype=bool))
    told = np.mean(fleet.base.angle_rad, axis=0) * room.robot.wheel_radius
    start = room.start_pose
    went = (fleet.base.x - start.x, fleet.base.y - start.y)
    lost = 1.0 - np.hypot(*went) / told
    singles = []
    for seed in range(40):
        simulator = Simulator(room, seed)
        for _ in range(800):
            simulator.step(Velocity(0.4, 0.0))
        pose, drive = simulator.drive.pose, simulator.drive
        told_m = (drive.left_angle_rad + drive.right_angle_rad) / 2 * room.robot.wheel_radius
        singles.append(1.0 - math.hypot(pose.x - start.x, pose.y - start.y) / told_m)
    spread = math.hypot(np.std(lost) / math.sqrt(count), np.std(singles) / math.sqrt(40))
    assert np.mean(lost) > 0.02
    assert abs(np.mean(lost) - np.mean(singles)) < 4 * spread


@pytest.mark.parametrize(
    ('changes', 'seeds', 'words'),
    [({}, (), 'seeds'), ({'anchors': ()}, (1,), 'anchors')],
)
def test_fleet_without_seeds_or_anchors_is_refused(make_scenario, changes, seeds, words):
    with pytest.raises(ConfigError, match=words):
        Fleet(make_scenario(**changes), seeds)


def test_fleet_with_unequal_crowds_is_refused(make_scenario, make_person):
    with pytest.raises(ConfigError, match='same number in every run'):
        Fleet(make_scenario(), (1, 2), [(make_person(),), ()])


def test_closest_counts_only_while_a_run_lasts(make_scenario, make_person):
    """Somebody who comes near after the end of a run does not spoil it."""
    room = make_scenario(people=(make_person(route=((9.0, 5.0), (5.8, 5.0)), radius=0.2),))
    fleet = Fleet(room, (1, 2))
    for step in range(600):
        fleet.step(np.zeros(2), np.zeros(2), np.array([True, step < 50]))
    record = fleet.record(np.full(2, fleet.now_ns))
    footprint = room.robot.footprint_radius
    # Stops for the robot within `yield_distance`.
    assert record.closest_m[0] == pytest.approx(0.6, abs=0.05)
    assert record.closest_m[1] > 4.0 - 0.5 - 0.2 - footprint - 0.1
    assert not record.blocked[:, 0].all()
