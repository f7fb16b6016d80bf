"""The whole simulation: rates, order, determinism, independence, layering and cost."""

from __future__ import annotations

import ast
import itertools
import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tablerunner.simulation
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.simulation import Contact, RangeTruth, Sample, Simulator, Truth
from tablerunner.types import (
    ExchangeSample,
    ImuSample,
    MagneticSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
)

RESTAURANT = Path(__file__).parents[3] / 'tablerunner_bringup' / 'scenarios' / 'restaurant.yaml'
MakeScenario = Callable[..., Scenario]


@pytest.fixture(scope='module')
def restaurant() -> Scenario:
    return load_scenario(RESTAURANT)


def run(simulator: Simulator, seconds: float) -> list[Sample]:
    """Drive a gentle slalom out of the kitchen."""
    samples: list[Sample] = []
    for step in range(round(seconds * 100)):
        command = Velocity(0.4, 0.3 * math.sin(0.02 * step)) if step % 10 == 0 else None
        samples.extend(simulator.step(command))
    return samples


def by_type(samples: list[Sample]) -> dict[type, list[Sample]]:
    sorted_out = defaultdict(list)
    for sample in samples:
        sorted_out[type(sample)].append(sample)
    return sorted_out


def test_simulator_samples_come_at_the_contract_rates(restaurant: Scenario) -> None:
    """In ten seconds: 50 Hz wheels and truth, 100 Hz IMU, 4 x 10 Hz UWB, five sonars in turn."""
    samples = run(Simulator(restaurant, 1), 10.0)
    counts = Counter(type(sample) for sample in samples)
    assert counts[WheelSample] == counts[Truth] == 500
    assert counts[ImuSample] == 1000
    assert counts[MagneticSample] == 200
    assert counts[RangeTruth] == 400
    lost = sum(isinstance(s, RangeTruth) and s.lost for s in samples)
    assert counts[ExchangeSample] == 400 - lost
    assert 0 < lost < 80
    assert counts[UltrasonicSample] == 333


def test_simulator_stamps_rise_and_are_never_zero(restaurant: Scenario) -> None:
    for stream in by_type(run(Simulator(restaurant, 1), 5.0)).values():
        stamps = np.array([sample.stamp for sample in stream])
        assert stamps[0] > 0
        assert (np.diff(stamps) > 0).all()


def test_simulator_same_seed_and_commands_give_the_same_samples(restaurant: Scenario) -> None:
    """Bit for bit, over half a minute with everything switched on."""
    first, second = (repr(run(Simulator(restaurant, 7), 30.0)) for _ in range(2))
    assert first == second


def test_simulator_other_seed_gives_other_errors_of_every_sensor(restaurant: Scenario) -> None:
    first, second = (by_type(run(Simulator(restaurant, seed), 5.0)) for seed in (7, 8))
    for kind in (WheelSample, ImuSample, MagneticSample, ExchangeSample, UltrasonicSample, Truth):
        assert repr(first[kind]) != repr(second[kind])


@pytest.mark.parametrize(
    ('silenced', 'kind'),
    [
        ('uwb', ExchangeSample),
        ('imu', ImuSample),
        ('magnetic', MagneticSample),
        ('ultrasonic', UltrasonicSample),
    ],
)
def test_simulator_silencing_one_sensor_leaves_the_others_bit_for_bit(
    restaurant: Scenario, silenced: str, kind: type
) -> None:
    """Each sensor draws from a stream of its own."""
    ideal = restaurant.sensors.ideal()
    quiet = restaurant.replace(
        sensors=restaurant.sensors.replace(**{silenced: getattr(ideal, silenced)})
    )
    noisy_run, quiet_run = (by_type(run(Simulator(s, 3), 5.0)) for s in (restaurant, quiet))
    for other in (WheelSample, ImuSample, MagneticSample, ExchangeSample, UltrasonicSample, Truth):
        same = repr(noisy_run[other]) == repr(quiet_run[other])
        assert same == (other is not kind)


def test_simulator_truth_comes_with_the_wheels(restaurant: Scenario) -> None:
    """Truth and wheel angles have the same stamps, so that one can be judged by the other."""
    samples = by_type(run(Simulator(restaurant, 2), 2.0))
    assert [s.stamp for s in samples[Truth]] == [s.stamp for s in samples[WheelSample]]


def test_simulator_without_errors_wheels_tell_the_truth(make_scenario: MakeScenario) -> None:
    """Dead reckoning by a formula of the test's own ends where the robot is."""
    simulator = Simulator(make_scenario(), 0)
    samples = by_type(run(simulator, 6.0))
    x, y, heading = 5.0, 5.0, 0.0
    wheels = samples[WheelSample]
    for last, this in itertools.pairwise(wheels):
        left = (this.left_angle_rad - last.left_angle_rad) * 0.06
        right = (this.right_angle_rad - last.right_angle_rad) * 0.06
        turned = (right - left) / 0.34
        x += (left + right) / 2 * math.cos(heading + turned / 2)
        y += (left + right) / 2 * math.sin(heading + turned / 2)
        heading += turned
    truth = samples[Truth][-1]
    assert (x, y) == pytest.approx((truth.pose.x, truth.pose.y), abs=1e-3)
    assert heading == pytest.approx(truth.pose.heading, abs=1e-6)
    assert truth.linear_m_s == pytest.approx(0.4, abs=1e-3)


def test_simulator_without_errors_gyroscope_tells_the_turn(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(errors={'imu': {'rate': 20.0}})
    samples = by_type(run(Simulator(scenario, 0), 6.0))
    turned = sum(sample.yaw_rate_rad_s for sample in samples[ImuSample]) / 20.0
    assert abs(turned) > 0.01
    assert turned == pytest.approx(samples[Truth][-1].pose.heading, abs=1e-9)


def test_simulator_refuses_commands_that_are_not_finite(make_scenario: MakeScenario) -> None:
    simulator = Simulator(make_scenario(), 0)
    samples = simulator.step(Velocity(math.nan, 0.0))
    assert [s.reason for s in samples if isinstance(s, Refusal)] == ['not finite']
    for _ in range(50):
        simulator.step()
    assert simulator.truth.pose.x == 5.0


def test_simulator_in_silence_stops(make_scenario: MakeScenario) -> None:
    """One command and no other: the base stands soon after."""
    simulator = Simulator(make_scenario(), 0)
    simulator.step(Velocity(0.5))
    for _ in range(20):
        simulator.step()
    assert simulator.truth.linear_m_s > 0.05
    for _ in range(120):
        simulator.step()
    assert simulator.truth.linear_m_s == pytest.approx(0.0, abs=1e-3)


def test_simulator_without_anchors_people_or_sonars_runs(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(anchors=(), walls=())
    bare = scenario.replace(robot=scenario.robot.replace(ultrasonics=()))
    kinds = {type(sample) for sample in run(Simulator(bare, 0), 1.0)}
    assert kinds == {Truth, WheelSample, ImuSample, MagneticSample}


def test_simulator_robot_leaves_the_kitchen_by_the_door_untouched(restaurant: Scenario) -> None:
    """The shipped door is where the home pose looks: 3 m straight ahead is free."""
    simulator = Simulator(restaurant.replace(people=()), 4)
    samples = [s for _ in range(800) for s in simulator.step(Velocity(0.4))]
    assert not [sample for sample in samples if isinstance(sample, Contact)]
    assert simulator.truth.pose.y < 11.0


def test_simulator_costs_little(restaurant: Scenario) -> None:
    """A simulated second takes less than 60 ms of CPU: it runs beside all nodes on two cores."""
    simulator = Simulator(restaurant, 1)
    run(simulator, 1.0)
    start = time.process_time()
    run(simulator, 5.0)
    assert (time.process_time() - start) / 5.0 < 0.06


def test_simulation_imports_nothing_that_it_is_used_to_judge() -> None:
    """Neither uwb, odometry, estimation, control nor ROS: a shared mistake would hide."""
    allowed = {'errors', 'types', 'config', 'geometry', 'scenario', 'simulation'}
    for path in Path(tablerunner.simulation.__file__).parent.glob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or '']
            for name in names:
                parts = name.split('.')
                assert parts[0] not in {'rclpy', 'sensor_msgs', 'tablerunner_ros'}
                if parts[0] == 'tablerunner':
                    assert parts[1] in allowed, f'{path.name} imports {name}'
