"""A simulated drive as a bag, and where the recordings of others are."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.writer import BagWriter
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.simulation import Simulator
from tablerunner.simulation.truth import Truth
from tablerunner.types import (
    ExchangeSample,
    ImuSample,
    MagneticSample,
    OdometrySample,
    UltrasonicSample,
    Velocity,
    WheelSample,
)

ROOT = Path(__file__).parents[4]
RESTAURANT = ROOT / 'src' / 'tablerunner_bringup' / 'scenarios' / 'restaurant.yaml'
ROUTE = ((7.2, 11.0), (5.2, 10.4), (5.2, 5.5), (5.2, 4.0), (9.8, 4.0), (9.8, 10.4), (7.2, 10.8))
TOPICS = ('joint_states', 'imu/data', 'imu/mag', 'uwb/exchanges', 'uwb/anchors', 'ground_truth')


@pytest.fixture(scope='session')
def restaurant() -> Scenario:
    """Return the scenario of the demo without its people: nobody minds our simple driver."""
    if not RESTAURANT.exists():
        pytest.skip('the restaurant scenario is part of tablerunner_bringup, which is not here')
    return replace(load_scenario(RESTAURANT), people=())


@pytest.fixture(scope='session')
def labyrinth_folder() -> Path:
    """Return the folder of the labyrinth recording, or skip."""
    given = os.environ.get('TABLERUNNER_DATA')
    folder = (Path(given) if given else ROOT.parent / 'shared' / 'data') / 'labyrinth_tuc'
    if not folder.is_dir():
        pytest.skip(
            f'the labyrinth recording is not at {folder} (TABLERUNNER_DATA names its parent)'
        )
    return folder


def steer(truth: Truth, goal: tuple[float, float]) -> Velocity:
    """Return a command that turns towards a point and drives there; any controller would do."""
    bearing = math.atan2(goal[1] - truth.pose.y, goal[0] - truth.pose.x) - truth.pose.heading
    turn = math.atan2(math.sin(bearing), math.cos(bearing))
    speed = 0.6 * max(0.0, math.cos(turn)) ** 3
    return Velocity(speed, float(np.clip(2.0 * turn, -1.2, 1.2)))


def simulate(
    scenario: Scenario,
    seed: int,
    duration_s: float,
    route: tuple[tuple[float, float], ...] = ROUTE,
) -> Iterator[tuple[str, int, object]]:
    """Yield (topic, stamp, message) of a drive along a route that ends where it began."""
    simulator = Simulator(scenario, seed)
    anchors = tuple(place.anchor for place in scenario.anchors)
    yield (
        'uwb/anchors',
        simulator.now_ns,
        messages.anchors_message(anchors, simulator.now_ns, 'map'),
    )
    target = 0
    for _ in range(round(duration_s * 100)):
        truth = simulator.truth
        goal = route[target]
        if math.hypot(goal[0] - truth.pose.x, goal[1] - truth.pose.y) < 0.3:
            target = (target + 1) % len(route)
        for sample in simulator.step(steer(truth, goal)):
            converted = _convert(sample)
            if converted is not None:
                yield (converted[0], sample.stamp, converted[1])


def _convert(sample: object) -> tuple[str, object] | None:
    if isinstance(sample, WheelSample):
        return 'joint_states', messages.wheels_message(sample, LEFT_JOINT, RIGHT_JOINT)
    if isinstance(sample, ImuSample):
        return 'imu/data', messages.imu_message(sample, 'imu_link')
    if isinstance(sample, MagneticSample):
        return 'imu/mag', messages.magnetic_message(sample, 'imu_link')
    if isinstance(sample, ExchangeSample):
        return 'uwb/exchanges', messages.exchange_message(sample, 'uwb_tag')
    if isinstance(sample, UltrasonicSample):
        return None
    if isinstance(sample, Truth):
        record = OdometrySample(sample.stamp, sample.pose, sample.linear_m_s, sample.angular_rad_s)
        return 'ground_truth', messages.odometry_message(record, 'map', 'base_link')
    return None


@pytest.fixture(scope='session')
def make_bag() -> Callable[..., Path]:
    """Return a function that writes a simulated drive into a bag."""

    def make(
        folder: Path, scenario: Scenario, seed: int, duration_s: float, storage: str = 'mcap'
    ) -> Path:
        with BagWriter(folder, storage) as bag:
            for topic in TOPICS:
                bag.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
            for topic, stamp, message in simulate(scenario, seed, duration_s):
                bag.write(topic, stamp, message)
        return folder

    return make


@pytest.fixture(scope='session')
def simulated_bag(
    make_bag: Callable[..., Path], restaurant: Scenario, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return a bag of half a minute of driving in the restaurant."""
    return make_bag(tmp_path_factory.mktemp('bags') / 'drive', restaurant, 1, 30.0)
